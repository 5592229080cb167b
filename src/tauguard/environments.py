"""Register the environments with Gymnasium; `gymnasium.make` imports their modules."""

#: Name -> module, prefix of the class names, and largest number of actions of an episode.
ENVIRONMENTS = {
    "tauguard/Reach-v0": ("reach", "Reach", 1000),
    "tauguard/React-v1": ("react", "React", 500),
    "tauguard/ClothReach-v1": ("cloth_reach", "ClothReach", 1000),
    "tauguard/TwoArms-v1": ("two_arms", "TwoArms", 1000),
}


def register_environments() -> None:
    """Register the environments once; do nothing if Gymnasium is not installed."""
    try:
        from gymnasium.envs.registration import register, registry
    except ModuleNotFoundError:
        return
    for name, (module, prefix, steps) in ENVIRONMENTS.items():
        if name not in registry:
            register(
                id=name,
                entry_point=f"tauguard.envs.gym.{module}:{prefix}Env",
                vector_entry_point=f"tauguard.envs.gym.{module}:{prefix}VectorEnv",
                max_episode_steps=steps,
            )
