"""Reporting of measurements: rates with intervals, tables, JSON, machine and versions."""

from tauguard.report.json_file import write_json
from tauguard.report.machine import machine, measured, versions
from tauguard.report.rates import poisson_rate, rate
from tauguard.report.table import WIDTH, Row, cell, table, two_digits

__all__ = [
    "WIDTH", "Row", "cell", "machine", "measured", "poisson_rate", "rate", "table", "two_digits",
    "versions", "write_json",
]  # fmt: skip
