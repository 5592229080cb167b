"""
A data set in polars
====================

A description of ten lines becomes a folder of Parquet files with a card. Data-frame libraries such
as polars, pandas and DuckDB read them.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import polars as pl

from tauguard.datasets import generate_dataset, load_configuration

folder = Path(tempfile.mkdtemp())
(folder / "small.toml").write_text("""
name = "small"
seed = 7
[[splits]]
name = "train"
episodes = 3
seconds = 20.0
struck = 1.0
arms = ["cura6"]
individuals = [0]
speeds = [30]
""")
generate_dataset(load_configuration(folder / "small.toml"), folder / "small", workers=1)

# %%

rows = pl.scan_parquet(folder / "small" / "data" / "*.parquet")
torque = pl.max_horizontal(pl.col(f"tau_ext_{k}").abs() for k in range(1, 5))
collisions = (
    rows.filter(pl.col("collision") >= 0)
    .group_by("episode", "collision")
    .agg(torque.max().alias("peak_nm"), pl.col("contact_force").max().alias("peak_n"))
    .sort("episode", "collision")
    .collect()
)
print(collisions)

plt.scatter(collisions["peak_n"], collisions["peak_nm"])
plt.xlabel("peak contact force [N]")
plt.ylabel("peak torque, joints 1 to 4 [N m]")
