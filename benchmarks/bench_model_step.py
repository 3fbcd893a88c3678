"""Measures the simulation time of the nonlinear model, against SciPy and plain C.

    tools/run python benchmarks/bench_model_step.py [--trajectories 4096] [--rounds 9]

All in one run, in turns: the compiled kernel over a whole motion, the same sample by sample from
Python, many trajectories at once on all processors, the same Runge-Kutta step in C with -O3 on one
(the limit), and SciPy's RK45 at rtol 1e-8 (what a user would write). The claims are the ratios:
each is the median over the rounds, so that a busy machine disturbs both sides alike.
"""

from __future__ import annotations

import argparse
import ctypes
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from measuring import parsed, timed
from scipy.integrate import solve_ivp

from slosh_model.batch import wall_heights
from slosh_model.constants import GRAVITY
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, Simulator, simulate

C_SOURCE = """
#include <math.h>
static void acc(const double *m, const double *s, const double *u, double *o) {
    double R = m[3], w = m[0], z = m[1], c2 = m[2]*m[2], xr = s[0]/R, yr = s[1]/R;
    double k = 2*z*w*c2*(xr*s[2]+yr*s[3]) + c2*(s[2]*s[2]+s[3]*s[3])/R + w*w*m[4]*(xr*xr+yr*yr)*R;
    double st = w*w*(1 + u[2]/9.81);
    double fx = -k*xr - 2*z*w*s[2] - st*s[0] - u[0], fy = -k*yr - 2*z*w*s[3] - st*s[1] - u[1];
    double a = 1+c2*xr*xr, b = c2*xr*yr, d = 1+c2*yr*yr, det = a*d-b*b;
    o[0] = s[2]; o[1] = s[3]; o[2] = (d*fx-b*fy)/det; o[3] = (a*fy-b*fx)/det;
}
void run(const double *m, const double *u, long n, double h, double *s) {
    for (long i = 1; i < n; i++) {
        const double *u0 = u+3*(i-1), *u1 = u+3*i;
        double um[3], k1[4], k2[4], k3[4], k4[4], t[4];
        for (int j = 0; j < 3; j++) um[j] = 0.5*(u0[j]+u1[j]);
        acc(m, s, u0, k1);
        for (int j = 0; j < 4; j++) t[j] = s[j]+0.5*h*k1[j];
        acc(m, t, um, k2);
        for (int j = 0; j < 4; j++) t[j] = s[j]+0.5*h*k2[j];
        acc(m, t, um, k3);
        for (int j = 0; j < 4; j++) t[j] = s[j]+h*k3[j];
        acc(m, t, u1, k4);
        for (int j = 0; j < 4; j++) s[j] += h/6*(k1[j]+2*k2[j]+2*k3[j]+k4[j]);
    }
}
"""
RATE, SECONDS = 1000.0, 5.0
SAMPLES = 2000
"""Of each of the many trajectories."""
# Greatest ratio to C of the kernel, step by step and of the batch; least of SciPy to the kernel.
GOALS = {"kernel / C": 1.6, "step by step / C": 8.6, "batch / C": 1.0 / 3.0}
SCIPY_GOAL = 300.0


def main() -> int:
    """Measures and prints times per sample and ratios; returns 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trajectories", type=int, default=4096)
    parser.add_argument("--rounds", type=int, default=9)
    given = parsed(parser, trajectories=8, rounds=1)
    model = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
    t = np.arange(int(SECONDS * RATE)) / RATE
    acceleration = pushes(t, 9.0)
    inputs = Inputs(t, acceleration)
    many = trajectories(given.trajectories)
    c_code, c_end = c_version(model, acceleration)
    ways: dict[str, tuple[Callable[[], object], int]] = {
        "C, -O3": (c_code, len(t)),
        "kernel": (lambda: simulate(model, inputs), len(t)),
        "step by step": (step_by_step(model, acceleration), len(t)),
        "batch": (lambda: wall_heights(model, many), SAMPLES * len(many)),
    }
    check_equal(model, many, inputs, c_code, c_end)
    rounds = [
        {name: timed(work) / count for name, (work, count) in ways.items()}
        for _ in range(given.rounds)
    ]
    scipy = min(timed(lambda: scipy_version(model, t, acceleration)) for _ in range(2)) / len(t)
    for name in ways:
        print(f"{name:14s} {1e9 * statistics.median(one[name] for one in rounds):9.0f} ns/sample")
    print(f"{'SciPy RK45':14s} {1e9 * scipy:9.0f} ns/sample")
    return report(rounds, scipy)


def report(rounds: Sequence[Mapping[str, float]], scipy: float) -> int:
    """Prints the time ratios with their goals; returns 1 if a goal is missed."""
    missed = 0
    for claim, goal in GOALS.items():
        name = claim.removesuffix(" / C")
        ratio = statistics.median(one[name] / one["C, -O3"] for one in rounds)
        missed |= ratio > goal
        print(f"{claim:18s} {ratio:8.2f}   goal: at most {goal:.2f}{', MISSED' * (ratio > goal)}")
    ratio = scipy / statistics.median(one["kernel"] for one in rounds)
    print(f"{'SciPy / kernel':18s} {ratio:8.0f}   goal: at least {SCIPY_GOAL:.0f}")
    return int(missed or ratio < SCIPY_GOAL)


def pushes(t: np.ndarray, frequency: float) -> np.ndarray:
    """Returns a motion's acceleration (N, 3) [m/s²]."""
    columns = [2 * np.sin(frequency * t), 2 * np.cos(7 * t) - 2, np.sin(11 * t)]
    return np.stack(columns, axis=1)


def trajectories(count: int) -> list[Inputs]:
    """Returns different motions of SAMPLES samples each."""
    t = np.arange(SAMPLES) / RATE
    return [Inputs(t, pushes(t, frequency)) for frequency in np.linspace(5.0, 10.0, count)]


def check_equal(
    model: Model,
    many: Sequence[Inputs],
    inputs: Inputs,
    c_code: Callable[[], None],
    c_end: Callable[[], np.ndarray],
) -> None:
    """Checks that C, batch and step-by-step simulations give equal results."""
    c_code()
    assert np.allclose(c_end(), simulate(model, inputs)[1].modal[0], rtol=1e-9), "C disagrees"
    for heights, motion in list(zip(wall_heights(model, many), many, strict=True))[::97]:
        simulator, dt = Simulator(model), 1.0 / RATE
        online = [simulator.step(dt, *row) for row in motion.acceleration.tolist()]
        assert np.allclose(heights, online, rtol=1e-12, atol=1e-15), "the batch disagrees"


def step_by_step(model: Model, acceleration: np.ndarray) -> Callable[[], None]:
    """Returns a function that simulates sample by sample, as the live estimator does."""
    simulator, samples = Simulator(model), acceleration.tolist()

    def run() -> None:
        simulator.reset()
        for ax, ay, az in samples:
            simulator.step(1.0 / RATE, ax, ay, az)

    return run


def constants(model: Model) -> tuple[float, ...]:
    """Returns the constants ω, ζ, C, R and α of a model's first mode."""
    (mode,) = model.mode_constants()
    alpha = next(use.parameters["alpha"] for use in model.effects if "alpha" in use.parameters)
    return (
        mode.natural_frequency,
        mode.damping_ratio,
        mode.curvature,
        mode.reach,
        alpha,
    )


def c_version(
    model: Model, acceleration: np.ndarray
) -> tuple[Callable[[], None], Callable[[], np.ndarray]]:
    """Compiles the same step in C; returns functions that run it and give its end state."""
    folder = Path(tempfile.mkdtemp())
    (folder / "step.c").write_text(C_SOURCE)
    command = ["cc", "-O3", "-shared", "-fPIC", "-o", "step.so", "step.c", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "step.so"))
    pointer = ctypes.POINTER(ctypes.c_double)
    mode, inputs, state = (
        np.array(constants(model)),
        np.ascontiguousarray(acceleration),
        np.zeros(4),
    )

    def run() -> None:
        state[:] = 0.0
        library.run(
            mode.ctypes.data_as(pointer),
            inputs.ctypes.data_as(pointer),
            ctypes.c_long(len(inputs)),
            ctypes.c_double(1.0 / RATE),
            state.ctypes.data_as(pointer),
        )

    return run, lambda: state


def scipy_version(model: Model, t: np.ndarray, acceleration: np.ndarray) -> None:
    """Simulates the motion with SciPy's RK45, as a user would write it."""
    omega, zeta, curvature, radius, alpha = constants(model)
    c2 = curvature**2

    def derivative(now: float, s: np.ndarray) -> list[float]:
        ax, ay, az = (np.interp(now, t, column) for column in acceleration.T)
        x, y, vx, vy = s
        xr, yr = x / radius, y / radius
        push = (
            2 * zeta * omega * c2 * (xr * vx + yr * vy)
            + c2 * (vx * vx + vy * vy) / radius
            + omega**2 * alpha * (xr * xr + yr * yr) * radius
        )
        stiffness = omega**2 * (1 + az / GRAVITY)
        force = [
            -push * xr - 2 * zeta * omega * vx - stiffness * x - ax,
            -push * yr - 2 * zeta * omega * vy - stiffness * y - ay,
        ]
        mass = [[1 + c2 * xr * xr, c2 * xr * yr], [c2 * xr * yr, 1 + c2 * yr * yr]]
        return [vx, vy, *np.linalg.solve(mass, force)]

    solve_ivp(derivative, (t[0], t[-1]), np.zeros(4), "RK45", rtol=1e-8, atol=1e-10)


if __name__ == "__main__":
    sys.exit(main())
