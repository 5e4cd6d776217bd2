// Compares our MAVLink codec with node-mavlink, byte for byte. First: npm install --no-save (in this folder).
//   node cross_check.js write > ../golden_frames.txt                     frames and the field values they carry
//   rosrun atmos_px4_bridge px4_codec_frames 100 | node cross_check.js check   reads our frames with node-mavlink
// A line: message id, sequence, hex of the frame, then name=value of every field; elements of arrays are joined by
// commas, numbers are the bits of the field as an unsigned integer.
const readline = require('readline');
const {MavLinkProtocolV2} = require('node-mavlink');
const {minimal, common, standard, x25crc} = require('mavlink-mappings');

const messages = {...minimal.REGISTRY, ...common.REGISTRY, ...standard.REGISTRY};
const ids = [0, 1, 2, 4, 11, 20, 22, 23, 30, 31, 32, 36, 69, 76, 77, 82, 83, 84, 85, 102, 105, 111, 138, 139, 140, 147,
  230, 245, 250, 253, 331, 350, 375, 385];
const bits = {uint8_t: 8, int8_t: 8, uint16_t: 16, int16_t: 16, uint32_t: 32, int32_t: 32, uint64_t: 64, int64_t: 64,
  float: 32, char: 8};
const kind = (field) => field.type.replace('_mavlink_version', '').replace('[]', '');
const width = (field) => bits[kind(field)];

function fromBits(field, value) {
  const type = kind(field);
  if (type === 'float') return new Float32Array(new Uint32Array([Number(value)]).buffer)[0];
  if (type.startsWith('int')) value = BigInt.asIntN(width(field), value);
  return width(field) === 64 ? value : Number(value);
}

function toBits(field, value) {
  if (kind(field) === 'float') return BigInt(new Uint32Array(new Float32Array([value]).buffer)[0]);
  return BigInt.asUintN(width(field), BigInt(value));
}

// xorshift: the same frames in every run.
let state = 0x9E3779B97F4A7C15n;
function random() {
  state ^= BigInt.asUintN(64, state << 13n);
  state ^= state >> 7n;
  state ^= BigInt.asUintN(64, state << 17n);
  return state;
}

function randomBits(field) {
  if (kind(field) === 'char') return 97n + random() % 26n;
  if (kind(field) === 'float') return toBits(field, Number(random() % 2000001n) / 1000 - 1000);
  return BigInt.asUintN(width(field), random());
}

function value(field, elements) {
  if (kind(field) === 'char') return String.fromCharCode(...elements.map(Number)).replace(/\0+$/, '');
  return field.type.includes('[]') ? elements.map((e) => fromBits(field, e)) : fromBits(field, elements[0]);
}

function write() {
  let sequence = 0;
  for (const id of ids) {
    const definition = messages[id];
    // Only the first field set; everything set; extensions zero; the second half zero: truncation ends somewhere in
    // between. A payload of zeros alone is left out: node-mavlink sends none of it, the MAVLink guide demands one byte.
    for (const zero of [(f, i) => i > 0, () => false, (f) => f.extension, (f, i, n) => i >= n / 2]) {
      const message = new definition();
      const texts = definition.FIELDS.map((field, index, all) => {
        const count = field.type.includes('[]') ? field.length : 1;
        const clear = zero(field, index, all.length);
        const elements = Array.from({length: count}, () => clear ? 0n : randomBits(field));
        message[field.name] = value(field, elements);
        return `${field.source}=${elements.join(',')}`;
      });
      const frame = new MavLinkProtocolV2(42, 191, 0, 0).serialize(message, sequence);
      console.log([id, sequence, frame.toString('hex'), ...texts].join(' '));
      sequence = (sequence + 1) % 256;
    }
  }
}

async function check() {
  let frames = 0, wrong = 0;
  const protocol = new MavLinkProtocolV2();
  for await (const line of readline.createInterface({input: process.stdin})) {
    const [id, sequence, hex, ...texts] = line.split(' ');
    const frame = Buffer.from(hex, 'hex');
    const definition = messages[id];
    const header = protocol.header(frame);

    const faults = [];
    if (header.msgid !== Number(id) || header.seq !== Number(sequence)) faults.push('header');
    if (x25crc(frame, 1, 2, definition.MAGIC_NUMBER) !== protocol.crc(frame)) faults.push('checksum');
    const message = protocol.data(protocol.payload(frame), definition);
    for (const text of texts) {
      const [name, list] = text.split('=');
      const field = definition.FIELDS.find((f) => f.source === name);
      const expected = value(field, list.split(',').map(BigInt));
      const same = (a, b) => Array.isArray(a) ? a.length === b.length && a.every((x, i) => same(x, b[i])) : Object.is(a, b);
      if (!same(message[field.name], expected)) faults.push(`${name}: ${message[field.name]} for ${expected}`);
    }
    ++frames;
    if (faults.length > 0) {
      ++wrong;
      console.error(`${definition.MSG_NAME}: ${faults.join('; ')}`);
    }
  }
  console.log(`${frames} frames, ${wrong} wrong`);
  process.exit(frames > 0 && wrong === 0 ? 0 : 1);
}

({write, check}[process.argv[2]] || (() => { console.error('usage: node cross_check.js write|check'); process.exit(2); }))();
