"""MuJoCo's own batched stepping from Python: physics only, no task. Prints JSON.

Every simulation walks canter's prior open loop, from standing, with the model's own time step:

- `mj_step`: one call a step on one robot;
- `mj_step nstep`: one call for each command, whose steps run inside the library;
- `rollout`: all commands of all robots in one call of `mujoco.rollout`;
- `batch`: one call of `mujoco.batch` a step for all robots, commands written before it.
"""

import argparse
import json
import pathlib
import resource
import sys
import time

import mujoco
import mujoco.batch
import mujoco.rollout
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import doggo


def walk(task, model, num_env_steps):
    """The prior's commands, `(T, nu)`, and the start, `(nq)`."""
    world = doggo.World(task, doggo.SinglePhysics(model), task.height_margin_m)
    world.reset(0, np.full(doggo.NUMBERS_PER_START, 0.5))
    start = world.physics.qpos[0].copy()
    phases = np.arange(num_env_steps) * task.preset["task"]["control_dt_s"] * world.law.frequency_hz % 1.0
    commands = np.zeros((num_env_steps, model.nu))
    actions = np.zeros((num_env_steps, task.num_actions))
    commands[:, world.actuators] = world.law.commands(phases, actions).reshape(num_env_steps, -1)
    return commands, start


def steps_per_s(run, num_steps, repeats):
    """The median over the repeats, the first of which does not count [1/s]."""
    times = []
    for _ in range(repeats + 1):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return num_steps / float(np.median(times[1:]))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("peer_task", help="the output of canter's peer_task")
    parser.add_argument("--threads", type=int, nargs="+", default=[1])
    parser.add_argument("--robots", type=int, default=32)
    parser.add_argument("--env-steps", type=int, default=200)
    parser.add_argument("--repeats", type=int, default=5)
    args = parser.parse_args()

    task = doggo.Task.load(args.peer_task)
    model = task.model()
    model.opt.timestep = mujoco.MjModel.from_xml_path(
        str(doggo.ROOT / "robots" / task.preset["robot"] / task.robot["model"])).opt.timestep
    num_substeps = round(task.preset["task"]["control_dt_s"] / model.opt.timestep)
    commands, start = walk(task, model, args.env_steps)
    num_steps = args.env_steps * num_substeps
    data = mujoco.MjData(model)

    def stepped(calls, nstep):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = start
        for command in commands:
            data.ctrl[:] = command
            for _ in range(calls):
                mujoco.mj_step(model, data, nstep)

    rows = [
        {"what": "mj_step", "threads": 1, "robots": 1,
         "mj_steps_per_s": steps_per_s(lambda: stepped(num_substeps, 1), num_steps, args.repeats)},
        {"what": "mj_step nstep", "threads": 1, "robots": 1,
         "mj_steps_per_s": steps_per_s(lambda: stepped(1, num_substeps), num_steps, args.repeats)},
    ]
    mujoco.mj_resetData(model, data)
    data.qpos[:] = start
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states = np.tile(state, (args.robots, 1))
    controls = np.repeat(commands, num_substeps, axis=0)[None]
    for threads in args.threads:
        datas = [mujoco.MjData(model) for _ in range(threads)]
        with mujoco.rollout.Rollout(nthread=threads) as pool:
            run = lambda: pool.rollout(model, datas, states, controls)
            rows.append({"what": "rollout", "threads": threads, "robots": args.robots,
                         "mj_steps_per_s": steps_per_s(run, args.robots * num_steps, args.repeats)})

        batch = mujoco.batch.Batch(model, nsim=args.robots, nthread=threads)
        qpos, ctrl = batch.bind("qpos"), batch.bind("ctrl")

        def batched():
            batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
            qpos[:] = start
            for command in commands:
                ctrl[:] = command
                for _ in range(num_substeps):
                    batch.step()

        rows.append({"what": "batch", "threads": threads, "robots": args.robots,
                     "mj_steps_per_s": steps_per_s(batched, args.robots * num_steps, args.repeats)})
    print(json.dumps({
        "physics_dt_s": model.opt.timestep, "rows": rows,
        "peak_resident_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6,
    }, indent=2))


if __name__ == "__main__":
    main()
