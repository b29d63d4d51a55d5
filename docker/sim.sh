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
if ! [ -e "$dir/clients" ]; then # one desk is let in, by the code that the log shows; others by docker exec
    gwrms keys pair "$dir/robot.toml" --host "$host" --port "${ROBOT_PAIRING_PORT:-7421}" \
        --name desk --role maintainer --yes &
    pairing=$!
    until [ -e "$dir/keys/robot.key" ]; do
        kill -0 "$pairing" 2>/dev/null || exit 1
        sleep 0.2
    done
fi
gwrms gateway "$dir/robot.toml" --host "$host" --port "$port" &
gateway=$!
while kill -0 "$sim" 2>/dev/null && kill -0 "$gateway" 2>/dev/null; do
    sleep 1 &
    wait $! # a signal is heard while it waits, and not while it sleeps
done
exit 1
