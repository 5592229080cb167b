"""``tauguard watch ENVIRONMENT``: show an environment live in the rerun viewer."""

import ast
import time
from pathlib import Path
from typing import Annotated, Any

import tyro

from tauguard.findings import ArgumentError

#: Keywords that may have several values, separated by commas.
LISTS = ("obstacles", "checkers")
#: Policies that need no file.
WORDS = ("target", "random", "still")


def command(
    environment: Annotated[str, tyro.conf.Positional],
    /,
    policy: str = "target",
    seconds: float = 30.0,
    seed: int = 0,
    set: tuple[str, ...] = (),
    reaction: str | None = None,
    save: Path | None = None,
    port: int = 9876,
) -> None:
    """Run an environment and show scene, forces, limits and detector live.

    Args:
        environment: an environment, such as Reach-v0, React-v1, ClothReach-v1 or TwoArms-v1.
        policy: target (straight to the target, Cartesian control), random, still, a file that
            examples/learn.py wrote (it contains the keywords of its training), or MODULE:NAME of a
            function from an observation to an action.
        seconds: simulated time, over one or more episodes.
        seed: seed of the first episode.
        set: keywords of the environment, NAME=VALUE each, as in --set detector=observer.
        reaction: reaction to an alarm or, without a detector, to a contact: stop0, stop1, stop2,
            retract, admittance.
        save: instead of opening the viewer, write an .rrd file, or write an MCAP recording of each
            complete episode into a folder, for `tauguard video`.
        port: port of the viewer, which listens on 127.0.0.1 only.
    """
    import gymnasium

    from tauguard.cli import expect
    from tauguard.environments import ENVIRONMENTS

    expect("--seed", seed, 0)
    expect("--port", port, 0, 65535)
    name = environment if environment.startswith("tauguard/") else f"tauguard/{environment}"
    if name not in ENVIRONMENTS:
        known = ", ".join(one.removeprefix("tauguard/") for one in ENVIRONMENTS)
        raise ArgumentError(f"environment {environment!r}: expected one of {known}")
    if not seconds > 0:
        raise ArgumentError(f"seconds {seconds}: expected above 0")
    keywords, learned = parsed(set), None
    if policy not in WORDS:
        learned = policy_of(policy, name)
        trained = getattr(learned, "environment", {})
        keywords = {key: value for key, value in trained.items() if key != "id"} | keywords
    if policy == "target":
        if keywords.get("control", "cartesian") != "cartesian":
            raise ArgumentError(
                "policy target needs control=cartesian; use --policy random or still"
            )
        keywords["control"] = "cartesian"
    env = gymnasium.make(name, **keywords)
    if reaction is not None:
        from tauguard.envs.wrappers import Reaction

        trigger = "alarm" if keywords.get("detector") else "contact"
        env = Reaction(env, reaction, trigger)
    if save is not None and save.suffix != ".rrd":
        from tauguard.envs.wrappers import RecordMcap

        env = RecordMcap(env, save)
    run(env, learned or policy, seconds, seed, save, port)


def policy_of(file: str, name: str) -> Any:
    """The policy in a file or a module.

    Raises:
        ArgumentError: there is none, or it was trained in another environment.
    """
    from importlib import import_module

    from tauguard.envs.policies import MlpPolicy

    if not Path(file).is_file():
        module, _, attribute = file.partition(":")
        try:
            function = getattr(import_module(module), attribute)
        except (ImportError, AttributeError, ValueError) as error:
            raise ArgumentError(
                f"policy {file}: no such file, and no MODULE:NAME ({error}); expected one of "
                f"these, or {', '.join(WORDS)}"
            ) from None
        if not callable(function):
            raise ArgumentError(f"policy {file}: cannot be called; expected a function")
        return function
    policy = MlpPolicy.load(file)
    if (trained := policy.environment.get("id", name).removeprefix("tauguard:")) != name:
        raise ArgumentError(f"policy {file}: it was trained in {trained}, not in {name}")
    return policy


def parsed(settings: tuple[str, ...]) -> dict[str, Any]:
    """Parse NAME=VALUE pairs; a value that is no Python literal is text."""
    found: dict[str, Any] = {}
    for item in settings:
        name, sign, text = item.partition("=")
        if not sign:
            raise ArgumentError(f"--set {item}: expected NAME=VALUE, as in detector=observer")
        try:
            found[name] = ast.literal_eval(text)
        except (ValueError, SyntaxError):
            many = name in LISTS and "," in text
            found[name] = tuple(part.strip() for part in text.split(",")) if many else text
    return found


def opened(inner: Any, save: Path | None, port: int) -> Any:
    """Open the viewer or, with ``save``, a writer of an .rrd file, and lay out the charts."""
    from tauguard.replay import LiveView

    view = LiveView(inner.compiled.shown(), save, port)
    charts = {
        "force": "Contact force [N], and in percent of its limit",
        "tau_ext": "External torque, truth [N m]",
        "residual": "Residual of the detector [N m]",
        "tool": "Distance to the target [m]",
    }
    if inner.batch.sensing is None:
        del charts["residual"]
    view.layout(charts)
    return view


def run(env: Any, policy: Any, seconds: float, seed: int, save: Path | None, port: int) -> None:
    """Run episodes for a simulated time, in real time unless they are written to a file."""
    inner = env.unwrapped
    view = opened(inner, save, port) if save is None or save.suffix == ".rrd" else None
    env.action_space.seed(seed)
    period, now, episodes, worst = 1 / inner.compiled.settings.control_rate, 0.0, 0, 0.0
    diverged = 0
    seen, info = env.reset(seed=seed)
    began = time.perf_counter()
    while now < seconds:
        if view is not None:
            send(view, inner, info, now)
        action = policy(seen) if callable(policy) else chosen(env, inner, policy)
        seen, _, terminated, truncated, info = env.step(action)
        now += period
        worst = max(worst, info["limit_ratio"])
        diverged += info["reason"].startswith("diverged")
        if terminated or truncated:
            episodes += 1
            seen, info = env.reset()
        if save is None:
            time.sleep(max(0.0, began + now - time.perf_counter()))
    if view is not None:
        view.close()
    env.close()
    where = f"; show it with: {'rerun' if view else 'tauguard video'} {save}" if save else ""
    print(
        f"{now:.1f} s, {episodes} episodes ended, "
        f"{f'{diverged} of them diverged, ' if diverged else ''}"
        f"largest force {100 * worst:.0f} % of its limit{where}"
    )


def chosen(env: Any, inner: Any, policy: Any) -> Any:
    """The action of the chosen policy."""
    import numpy as np

    if policy == "random":
        return env.action_space.sample()
    if policy == "still":
        return np.zeros(env.action_space.shape)
    batch = inner.batch
    n, arms = len(inner.compiled.scene.joint_names), inner.compiled.arms
    at = 3 * n + 3 * arms
    left = batch.observation[0, at : at + 3 * arms].reshape(arms, 3)
    action = np.zeros((arms, 6))
    largest = np.array([entry.high for entry in batch.actions]).reshape(arms, 6)[:, :3]
    # A tenth of the distance per step, so that the tool slows down before it arrives.
    action[:, :3] = np.clip(0.1 * left / largest, -1, 1)
    return action.ravel()


def send(view: Any, inner: Any, info: dict[str, Any], now: float) -> None:
    """Send the scene and the charts of one instant."""
    import numpy as np

    batch, names = inner.batch, list(inner.compiled.scene.joint_names)
    view.show(batch.datas[0], now, batch.target[0])
    contact = batch.contact[0]
    strongest = contact[contact["net_force"].argmax()]
    view.contact(strongest["point"], strongest["force"] if info["force"] else np.zeros(3))
    percent = 100 * info["limit_ratio"]
    view.chart("force", ["force [N]", "of the limit [%]"], [info["force"], percent])
    view.chart("tau_ext", names, info["tau_ext"])
    if batch.sensing is not None:
        view.chart("residual", [*names, "alarm"], [*info["residual"], float(info["alarm"])])
    view.chart("tool", ["distance"], [info["distance"]])
