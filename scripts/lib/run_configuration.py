"""What was running when a bag was recorded: prints it, or writes the recorded configuration files to a folder."""
import argparse
import hashlib
import html
import os
import sys

import rosbag


def digest_of(files):
    """sha256 over who uses which content, as the recorder (atmos_operator/run_configuration.h) makes it."""
    lines = sorted("".join(user + "\n" for user in entry.used_by) + entry.sha256 + "\n" for entry in files)
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def faults(configuration):
    """What does not agree with the recorded digests."""
    found = [f"{entry.path}: content does not have the sha256 {entry.sha256}" for entry in configuration.files
             if hashlib.sha256(entry.content.encode()).hexdigest() != entry.sha256]
    if digest_of(configuration.files) != configuration.digest:
        found.append("the digest over all files does not agree")
    return found


def configuration_lines(configuration, files=True):
    """Lines that say what was running."""
    if configuration is None:
        return ["configuration: not recorded"]
    lines = [f"configuration: {len(configuration.files)} files, digest {configuration.digest[:16]}, "
             f"revision {configuration.revision or 'unknown'}"]
    if files:
        lines += [f"  {entry.sha256[:16]}  {entry.path}  ({', '.join(entry.used_by)})" for entry in configuration.files]
        lines += [f"  {text}" for text in configuration.parameters]
    return lines + [f"  FAULT: {text}" for text in faults(configuration)]


def configuration_html(configuration):
    """The same for a page, with the files' content to open."""
    if configuration is None:
        return "<p>The recording does not say.</p>"
    lines = configuration_lines(configuration, files=False)
    parts = [f"<p>{'<br>'.join(html.escape(line) for line in lines)}</p>"]
    for entry in configuration.files:
        parts.append(f"<details><summary>{html.escape(entry.path)} <code>{entry.sha256[:16]}</code></summary>"
                     f"<p>named by {html.escape(', '.join(entry.used_by))}</p><pre>{html.escape(entry.content)}</pre></details>")
    parts.append("<details><summary>parameters</summary><pre>" + html.escape("\n".join(configuration.parameters)) + "</pre></details>")
    return "\n".join(parts)


def read(path):
    """The last configuration in a bag; None when there is none."""
    last = None
    with rosbag.Bag(path) as bag:
        topics = [topic for topic, info in bag.get_type_and_topic_info().topics.items()
                  if info.msg_type == "atmos_msgs/RunConfiguration"]
        for _, message, _ in bag.read_messages(topics=topics) if topics else []:
            last = message
    return last


def main():
    parser = argparse.ArgumentParser(prog="scripts/configuration", description=__doc__)
    parser.add_argument("bag", metavar="BAG")
    parser.add_argument("--out", metavar="DIR", help="writes the files there, each under its name")
    args = parser.parse_args()
    try:
        configuration = read(args.bag)
    except (OSError, rosbag.ROSBagException) as error:
        print(f"error: {args.bag}: {error}", file=sys.stderr)
        return 2
    print("\n".join(configuration_lines(configuration)))
    if configuration is None:
        return 1
    if args.out:
        os.makedirs(args.out, exist_ok=True)
        for entry in configuration.files:
            with open(os.path.join(args.out, os.path.basename(entry.path)), "w") as file:
                file.write(entry.content)
    return 1 if faults(configuration) else 0


if __name__ == "__main__":
    sys.exit(main())
