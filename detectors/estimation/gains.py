"""The rate of the momentum observer [1/s], for every use of it.

A faster observer follows a blow sooner and passes more noise; a rate far above a fifth of the
sampling rate brings no more. Whoever differs from another does so on purpose, and says why here.
"""

from __future__ import annotations

#: Reports, recordings and calls that name no rate.
PLAIN_GAIN = 100.0
#: Detectors at a kilohertz and the diagnosis after their alarms: 5 ms of lag.
DETECTION_GAIN = 200.0
#: The environments' observer: its alarm must stay down over a control step's jumps.
ENVIRONMENT_GAIN = 50.0
#: Logs of real arms without training, from 100 Hz: what their friction allows.
LOG_GAIN = 20.0
