"""Labelled datasets (description, generation, inspection, reading) and loaders of real logs."""

from tauguard.lazy import on_demand

__getattr__, __dir__, __all__ = on_demand(
    __name__,
    {
        "alarm_files": "judged_alarms",
        "arm_logs": "read_log read_logs simulated",
        "columns": "AS_IS ColumnMap PRESETS Reading",
        "dataset_folder": "configuration_in",
        "inspection": "episode_line inspect_dataset simulated_again",
        "inspection_figure": "draw_inspection",
        "schedule": "class_order",
        "workers": "Terminated",
        "configuration": "Configuration Split load_configuration",
        "generation": "generate_dataset",
        "plans": "DemoPlan SPEEDS TRAINING_PAYLOADS collision_plans demo_plan free_episodes "
        "struck_episodes torque_scale",
        "reader": "arms_of episodes_of_splits read",
        "recordings": "simulate_all write_dataset",
        "twin_episodes": "TwinEpisodes twin_contacts",
    },
)
