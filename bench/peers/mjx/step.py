"""MuJoCo XLA (MJX) on the processor: physics only, many robots in one compiled call. Prints JSON.

All robots stand still with the model's own time step. What MJX does not support is reported with its error.
"""

import argparse
import contextlib
import json
import pathlib
import resource
import sys
import time

import jax
import mujoco

# Without the GPU's packages it says so on the standard output.
with contextlib.redirect_stdout(sys.stderr):
    from mujoco import mjx

ROOT = pathlib.Path(__file__).resolve().parents[3]


def measure(num_robots, num_steps):
    """Compile time and steps per second of `num_steps` steps of as many robots."""
    model = mujoco.MjModel.from_xml_path(str(ROOT / "robots/doggo/doggo.xml"))
    mjx_model = mjx.put_model(model)
    data = jax.vmap(lambda _: mjx.make_data(mjx_model))(jax.numpy.arange(num_robots))

    def advance(data, _):
        return jax.vmap(mjx.step, in_axes=(None, 0))(mjx_model, data), None

    run = jax.jit(lambda data: jax.lax.scan(advance, data, None, length=num_steps)[0])
    start = time.perf_counter()
    compiled = run.lower(data).compile()
    compile_s = time.perf_counter() - start
    times = []
    for _ in range(2):
        start = time.perf_counter()
        data = compiled(data)
        data.qpos.block_until_ready()
        times.append(time.perf_counter() - start)
    return {"compile_s": compile_s, "mj_steps_per_s": num_robots * num_steps / times[-1],
            "height_m": float(data.qpos[0, 2])}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--robots", type=int, default=32)
    parser.add_argument("--steps", type=int, default=100)
    args = parser.parse_args()
    report = {"robots": args.robots, "steps": args.steps, "device": str(jax.devices()[0])}
    try:
        report |= measure(args.robots, args.steps)
    except (NotImplementedError, ValueError) as error:
        report["unsupported"] = str(error)
    report["peak_resident_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    print(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
