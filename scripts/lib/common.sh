# Sourced by every script: where the workspace is, the environment ROS 1 needs on Debian 12, and messages.
# shellcheck shell=bash
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)"
cd "$root"

# Debian's own Python has rospy and catkin; a pyenv or conda python first on PATH does not.
export PATH="/usr/bin:/bin:/usr/sbin:/sbin:$PATH"
unset PYTHONPATH
export ROS_HOSTNAME=localhost ROS_HOME="$root/.ros" ROS_LOG_DIR="$root/.ros/log"
export ROSCONSOLE_STDOUT_LINE_BUFFERED=1 MPLBACKEND=Agg
# One message per line, without the time stamp that differs from run to run.
export ROSCONSOLE_FORMAT='[${severity}] ${node}: ${message}'
mkdir -p "$ROS_LOG_DIR"

say() { printf '\033[1m== %s\033[0m\n' "$*"; }
fail() { printf 'error: %s\n' "$*" >&2; exit 1; }

source_workspace() {
  [ -f "$root/devel/setup.bash" ] || fail "the workspace is not built: run scripts/build first"
  set +u
  # shellcheck disable=SC1091
  source "$root/devel/setup.bash"
  set -u
}

# A port of its own for a ROS master, so that nothing else on this machine is disturbed.
use_free_master() {
  local port
  port=$(/usr/bin/python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
  export ROS_MASTER_URI="http://localhost:$port"
}
