"""Of the robot's computer: what makes frames late."""

from collections.abc import Iterator

from drivers.realtime_priority import PRIORITY
from gateway.config.robot import header
from gateway.doctor.gathering.computer import links, usb_name
from gateway.doctor.observations import Observations
from gateway.doctor.verdicts import Finding, Run, Unknown, Verdict

MOST_LATENCY_MS = 4
LEAST_QUEUE = 100  # frames
WANTED_QUEUE = 1000
QUICK_GOVERNORS = ("performance",)
_ABOUT = "the robot's computer"


def latency_timer(seen: Observations) -> Iterator[Verdict]:
    """Yield a USB serial adapter that gathers bytes for so long that frames come in bursts."""
    timers = seen.computer.latency_ms
    ports = list(seen.config.on_ports())
    if not ports:
        yield Unknown("latency_timer", "sensors", "the robot has none on a serial port")
    for where, sensor in ports:
        if timers is None or sensor.port in seen.computer.missing_ports:
            why = seen.computer.why_none if timers is None else f"{sensor.port} does not exist"
            yield Unknown("latency_timer", where, why)
            continue
        device = usb_name(sensor.port)
        latency = timers.get(device)
        if latency is not None and latency > MOST_LATENCY_MS:
            file = f"/sys/bus/usb-serial/devices/{device}/latency_timer"
            rule = 'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"'
            yield Finding(
                "latency_timer",
                where,
                f"its adapter gathers bytes for {latency} ms: frames come in bursts, and late",
                (f"{file}: {latency}",),
                (
                    Run(f"echo 1 | sudo tee {file}"),
                    Run(f"echo '{rule}' | sudo tee /etc/udev/rules.d/99-latency.rules   # so that it stays"),
                ),
            )


def clock(seen: Observations) -> Iterator[Verdict]:
    """Yield a clock that nobody sets: recordings of two computers do not fit together."""
    if seen.computer.clock_synchronised is None:
        yield Unknown("clock", _ABOUT, seen.computer.why_none)
    elif not seen.computer.clock_synchronised:
        yield Finding(
            "clock",
            _ABOUT,
            "its clock is not synchronised: what was recorded when cannot be compared with other computers",
            ("the kernel says so (adjtimex: TIME_ERROR)",),
            (
                Run("sudo timedatectl set-ntp true"),
                Run("sudo apt install chrony   # on a network of its own: with the desk as its server"),
            ),
        )


def governor(seen: Observations) -> Iterator[Verdict]:
    """Cores that first have to wake up."""
    governors = seen.computer.governors
    if governors is None:
        yield Unknown("governor", _ABOUT, f"no governor is told: {seen.computer.why_none}")
    elif slow := [one for one in governors if one not in QUICK_GOVERNORS]:
        yield Finding(
            "governor",
            _ABOUT,
            f"its cores save power ({slow[0]}): what must not be late waits until they are fast",
            (f"scaling_governor: {', '.join(sorted(set(governors)))} on {len(governors)} cores",),
            (
                Run("echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"),
                Run("sudo systemctl enable --now cpupower   # so that it stays, with GOVERNOR=performance"),
            ),
        )


def realtime(seen: Observations) -> Iterator[Verdict]:
    """Yield whether the gateway lacks the right to real-time priority for a stop."""
    if seen.computer.realtime_allowed is None:
        yield Unknown("realtime", _ABOUT, seen.computer.why_none)
    elif not seen.computer.realtime_allowed:
        yield Finding(
            "realtime",
            _ABOUT,
            "a stop and the guard have no real-time priority: on a busy computer they are late",
            (f"RLIMIT_RTPRIO is below {PRIORITY}, and there is no CAP_SYS_NICE",),
            (
                Run(f"gwrms install-service {seen.config.path}   # its unit has LimitRTPRIO={PRIORITY}"),
                Run(
                    f"echo '@gwrms - rtprio {PRIORITY}' | sudo tee /etc/security/limits.d/gwrms.conf"
                    "   # for a gateway that is started by hand, by a member of that group"
                ),
            ),
        )


def txqueuelen(seen: Observations) -> Iterator[Verdict]:
    """Yield a CAN interface that has room for a handful of frames."""
    for name, settings in seen.config.can.items():
        link = links(settings)
        length = None if link is None else seen.computer.queue_lengths.get(link)
        if link is not None and length is None:
            yield Unknown("txqueuelen", header("can", name), f"{link}: {seen.computer.why_none}")
        elif length is not None and length < LEAST_QUEUE:
            yield Finding(
                "txqueuelen",
                header("can", name),
                f"{link} has room for {length} frames that wait: a burst of requests is lost",
                (f"/sys/class/net/{link}/tx_queue_len: {length}",),
                (Run(f"sudo ip link set {link} txqueuelen {WANTED_QUEUE}"),),
            )
