#!/bin/sh
# A simulated robot and its gateway, which end together; the arguments are those of gwrms sim.
set -eu
dir=${ROBOT_DIR:-/data/robot}
port=${ROBOT_PORT:-7420}

mkdir -p "$dir"
rm -f "$dir/ready"
gwrms sim --dir "$dir" "$@" >"$dir/ready" &
sim=$!
gateway=
end() {
    trap - EXIT INT TERM
    kill $gateway "$sim" 2>/dev/null || true
    wait
}
trap 'end; exit 143' INT TERM
trap end EXIT

until grep -q ready "$dir/ready"; do
    kill -0 "$sim" 2>/dev/null || exit 1 # it has said why
    sleep 0.2
done
gwrms gateway "$dir/robot.toml" --host "${ROBOT_HOST:-0.0.0.0}" --port "$port" &
gateway=$!
while kill -0 "$sim" 2>/dev/null && kill -0 "$gateway" 2>/dev/null; do
    sleep 1 &
    wait $! # a signal is heard while it waits, and not while it sleeps
done
exit 1
