"""Reporting of measurements: rates with intervals, tables, JSON, machine and versions."""

from tauguard.report.digits import two_digits
from tauguard.report.json_file import write_json
from tauguard.report.machine import machine, measured, versions
from tauguard.report.rates import rate
from tauguard.report.table import WIDTH, Row, cell, table

__all__ = [
    "WIDTH",
    "Row",
    "cell",
    "machine",
    "measured",
    "rate",
    "table",
    "two_digits",
    "versions",
    "write_json",
]
