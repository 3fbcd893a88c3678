"""Cost of simulating the nonlinear model, against SciPy and against plain C.

    tools/run python benchmarks/bench_model_step.py

All in one run, best of several: the compiled kernel over a whole motion, the same sample by sample
from Python (as the live estimator calls it), SciPy's RK45 at rtol 1e-8 (what a user would write),
and the same Runge-Kutta step in C with -O3 (the limit). The claim is the ratios.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from slosh_model.constants import GRAVITY
from slosh_model.containers import Cylinder
from slosh_model.model import Model
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
RATE, SECONDS, REPEATS = 1000.0, 5.0, 7


def main() -> None:
    """Measures and prints seconds of computing per second of motion, and the ratios."""
    model = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
    t = np.arange(int(SECONDS * RATE)) / RATE
    acceleration = np.stack([2 * np.sin(9 * t), 2 * np.cos(7 * t) - 2, np.sin(11 * t)], axis=1)
    inputs = Inputs(t, acceleration)
    kernel = best(lambda: simulate(model, inputs))
    stepwise = best(step_by_step(model, acceleration))
    c_code, c_end = c_version(model, acceleration)
    c_time = best(c_code)
    scipy = best(lambda: scipy_version(model, t, acceleration), repeats=2)
    end = simulate(model, inputs)[1].modal[0]
    assert np.allclose(c_end(), end, rtol=1e-9), "C and the kernel disagree"
    steps = len(t)
    print(f"compiled kernel      {1e9 * kernel / steps:8.0f} ns per sample")
    print(f"step by step         {1e9 * stepwise / steps:8.0f} ns per sample")
    print(f"C, -O3               {1e9 * c_time / steps:8.0f} ns per sample")
    print(f"SciPy RK45           {1e9 * scipy / steps:8.0f} ns per sample")
    print(f"kernel / C           {kernel / c_time:8.2f}")
    print(f"SciPy / kernel       {scipy / kernel:8.0f}")


def best(action: Callable[[], object], repeats: int = REPEATS) -> float:
    """Shortest of several runs [s]; the first, which may compile, does not count."""
    action()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        action()
        times.append(time.perf_counter() - started)
    return min(times)


def step_by_step(model: Model, acceleration: np.ndarray) -> Callable[[], None]:
    """The live estimator's way."""
    simulator, samples = Simulator(model), acceleration.tolist()

    def run() -> None:
        simulator.reset()
        for ax, ay, az in samples:
            simulator.step(1.0 / RATE, ax, ay, az)

    return run


def constants(model: Model) -> tuple[float, ...]:
    """ω, ζ, C, R, α."""
    (mode,) = model.mode_constants()
    alpha = next(use.parameters["alpha"] for use in model.effects if "alpha" in use.parameters)
    return (
        mode.natural_frequency,
        mode.damping_ratio,
        mode.curvature,
        mode.container.radius,
        alpha,
    )


def c_version(
    model: Model, acceleration: np.ndarray
) -> tuple[Callable[[], None], Callable[[], np.ndarray]]:
    """The same step in C, and the state that it ends in."""
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
    """What a user would write with SciPy."""
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
    main()
