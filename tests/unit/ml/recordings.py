"""Made-up recordings in the benchmarks' formats: people who walk, turn, stand and fall like clockwork."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ml.benchmarks import impaired, ipol, sisfall, terrain

Arrays = dict[str, npt.NDArray[Any]]
STAND, WALK, TURN = range(3)


def foot(phase: npt.NDArray[np.float64], walking: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64]:
    """(rows, 6) of a foot that swings forward in the last 40 % of its stride and strikes at phase 0."""
    swing = walking & (phase > 0.6)
    pitch = np.where(swing, 5.0 * np.sin((phase - 0.6) / 0.4 * 2 * np.pi - np.pi), 0.0)
    pitch = np.where(swing & (phase > 0.8), 5.0 * np.sin((phase - 0.8) / 0.2 * np.pi), pitch)
    blow = np.where(walking & (phase < 0.05), 8.0, 0.0)
    zero = np.zeros_like(phase)
    return np.stack([9.0 + blow, zero, 4.0 - blow, zero, pitch, zero], axis=1)


def trial(seconds: float, stride: float, noise: np.random.Generator) -> tuple[Any, ...]:
    """Stand, walk for so long, turn 1.5 s, walk, stand: samples, status, and each foot in the air."""
    parts = ((STAND, 2.0), (WALK, seconds / 2), (TURN, 1.5), (WALK, seconds / 2), (STAND, 1.0))
    status = np.concatenate([np.full(int(100 * length), state) for state, length in parts])
    moves = status != STAND
    phase = np.cumsum(np.where(moves, 0.01 / stride, 0.0)) % 1.0
    phases = (phase, (phase + 0.5) % 1.0)
    left, right = (foot(one, moves) for one in phases)
    back = np.zeros((len(status), 6))
    back[:, 0] = 9.8 + np.where(moves, 2.0 * np.cos(4 * np.pi * phase), 0.0)
    back[:, 3] = np.where(status == TURN, 2.0, 0.0)
    samples = np.concatenate([back, left, right], axis=1)
    in_air = [moves & (one > 0.6) for one in phases]
    return samples + noise.normal(0, 0.05, samples.shape), status, *in_air


def gait(subjects: int = 3, trials: int = 2, seconds: float = 8.0) -> Arrays:
    noise = np.random.default_rng(0)
    made = [
        (*trial(seconds, 1.0 + 0.05 * person, noise), person, number)
        for person in range(subjects)
        for number in range(trials)
    ]
    rows = [len(one[1]) for one in made]
    return {
        "x": (np.concatenate([one[0] for one in made]) * 1000).astype(np.int16),
        "scale": np.full(18, 0.001),
        "channels": np.array(ipol.CHANNELS),
        "status": np.concatenate([one[1] for one in made]).astype(np.int8),
        "status_names": np.array(ipol.STATUSES),
        "left_event": np.concatenate([one[2] for one in made]).astype(np.int8),
        "right_event": np.concatenate([one[3] for one in made]).astype(np.int8),
        "subject": np.repeat([one[4] for one in made], rows).astype(np.int16),
        "trial": np.repeat([one[5] for one in made], rows).astype(np.int16),
        "rate": np.array(100),
    }


def patients(healthy: int = 3, limping: int = 3, trials: int = 2, seconds: float = 8.0) -> Arrays:
    """Feet of healthy people, and of some who hardly lift their heels and swing for longer; two sensors."""
    noise = np.random.default_rng(3)
    made = []
    for person in range(healthy + limping):
        limps = person >= healthy
        for number in range(trials):
            rates, moving = feet(seconds, 1.0 + 0.02 * person, limps=limps)
            rates = rates + noise.normal(0, 0.02, rates.shape)
            made.append((rates, moving, person, number, int(limps), person % 2))
    rows = [len(one[0]) for one in made]
    moving = np.concatenate([one[1] for one in made]).astype(np.int8)
    about = [np.repeat([one[at] for one in made], rows) for at in range(2, 6)]
    return {
        "x": (np.concatenate([one[0] for one in made]) * 1000).astype(np.int16),
        "scale": np.full(6, 0.001),
        "channels": np.array(impaired.CHANNELS),
        "subject": about[0].astype(np.int16),
        "trial": about[1].astype(np.int16),
        "group": about[2].astype(np.int8),
        "group_names": np.array([impaired.HEALTHY, "limping"]),
        "sensor": about[3].astype(np.int8),
        "sensor_names": np.array(["even", "odd"]),
        "left_moving": moving[:, 0],
        "right_moving": moving[:, 1],
        "rate": np.array(100),
    }


def feet(
    seconds: float, stride: float, *, limps: bool
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """Angular velocity (rows, 6) and whether each foot moves (rows, 2): stand 2 s, walk, stand 1 s."""
    walks = np.repeat([False, True, False], [200, int(100 * seconds), 100])
    phase = np.cumsum(np.where(walks, 0.01 / stride, 0.0)) % 1.0
    rates = np.zeros((len(walks), 6))
    moving = np.zeros((len(walks), 2), dtype=bool)
    begin = 0.4 if limps else 0.6  # of the stride, where the heel leaves the ground
    for place, one in enumerate((phase, (phase + 0.5) % 1.0)):
        share = np.clip((one - begin) / (1.0 - begin), 0.0, 1.0)
        pitch = np.where(share < 0.5, -(2.0 if limps else 6.0), 5.0) * np.abs(np.sin(2 * np.pi * share))
        rates[:, 3 * place + 1] = np.where(walks & (one > begin), pitch, 0.0)
        rates[:, 3 * place + 1] -= np.where(walks & (one < 0.08), 1.0, 0.0)  # the foot comes down on its heel
        moving[:, place] = walks & ((one > begin) | (one < 0.08))
    return rates, moving


def fall(noise: np.random.Generator) -> tuple[npt.NDArray[np.float64], int]:
    """Standing, then half a second of tipping over and getting light, then a blow."""
    samples = np.zeros((200, 6))
    samples[:, 1] = 9.81
    samples[120:145, 1] = np.linspace(9.0, 2.0, 25)
    samples[120:145, 5] = np.linspace(0.5, 4.0, 25)
    samples[145:150, 1] = 40.0
    samples[150:, 0], samples[150:, 1] = 9.81, 0.0
    return samples + noise.normal(0, 0.1, samples.shape), 146


def daily(noise: np.random.Generator) -> npt.NDArray[np.float64]:
    """Walking."""
    samples = np.zeros((300, 6))
    samples[:, 1] = 9.81 + 2.0 * np.sin(np.arange(300) * 0.25)
    return samples + noise.normal(0, 0.1, samples.shape)


def falls(subjects: int = 4, each: int = 3) -> Arrays:
    noise = np.random.default_rng(1)
    samples, about = [], []
    for person in range(subjects):
        for number in range(each):
            fallen, impact = fall(noise)
            samples += [fallen, daily(noise), daily(noise)]
            about += [
                ("F01", f"S{person}", number, impact),
                ("D01", f"S{person}", number, 10),
                (sisfall.STUMBLE if number == 0 else "D02", f"S{person}", number, 10),
            ]
    lengths = [len(one) for one in samples]
    activity, subject, trials, peak = (np.array(column) for column in zip(*about, strict=True))
    return {
        "x": (np.concatenate(samples) * 100).astype(np.int16),
        "scale": np.full(6, 0.01),
        "channels": np.array(sisfall.CHANNELS),
        "rate": np.array(50),
        "rec_activity": activity,
        "rec_subject": subject,
        "rec_trial": trials,
        "rec_start": np.cumsum([0, *lengths[:-1]]),
        "rec_len": np.array(lengths),
        "rec_peak_acc_index": peak,
    }


def ground(each: int = 24) -> Arrays:
    """Windows of four grounds that differ in the hips, from every heading; pairs share a row."""
    noise = np.random.default_rng(2)
    modes = np.repeat(np.arange(4), each)
    x = noise.normal(0, 0.05, (len(modes), 11, 13))
    x[..., 0] += 0.3 * modes[:, None]
    x[..., 2] += np.where(modes == 1, 2.0, 0.0)[:, None]
    x[..., 6] -= 9.81
    x[..., 12] = np.resize(np.arange(-165.0, 180.0, 30.0), len(modes))[:, None]
    x[1::2, 0] = x[0::2, 10]
    channels = (*terrain.CHANNELS, terrain.YAW)
    names = np.array([*terrain.MODES, "fall"])
    return {
        "x": x.astype(np.float32),
        "y": modes.astype(np.int8),
        "channels": np.array(channels),
        "names": names,
        "rate": np.array(50),
    }


def saved(path: Path, arrays: Arrays) -> Path:
    np.savez(path, allow_pickle=False, **arrays)
    return path
