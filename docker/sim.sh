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
pairing=
end() {
    trap - EXIT INT TERM
    kill $gateway $pairing "$sim" 2>/dev/null || true
    wait
}
trap 'end; exit 143' INT TERM
trap end EXIT

until grep -q ready "$dir/ready"; do
    kill -0 "$sim" 2>/dev/null || exit 1 # it has said why
    sleep 0.2
done
host=${ROBOT_HOST:-0.0.0.0}
serve() {
    gwrms gateway "$dir/robot.toml" --host "$1" --port "$port" &
    gateway=$!
}
if [ -e "$dir/keys/robot.key" ]; then
    has_keys=yes
    serve "$host"
else # one desk is let in, by the code that the log shows; others by docker exec
    has_keys=
    gwrms keys pair "$dir/robot.toml" --host "$host" --port "${ROBOT_PAIRING_PORT:-7421}" \
        --name desk --role maintainer --yes &
    pairing=$!
    serve 127.0.0.1 # the container alone, until there are keys
fi
while kill -0 "$sim" 2>/dev/null && kill -0 "$gateway" 2>/dev/null; do
    if [ -z "$has_keys" ] && [ -e "$dir/keys/robot.key" ]; then # made with the first desk, now or later
        has_keys=yes
        kill "$gateway"
        wait "$gateway" || true
        serve "$host"
    fi
    sleep 1 &
    wait $! # a signal is heard while it waits, and not while it sleeps
done
exit 1
