"""Read a ROS 2 topic of type sensor_msgs/JointState (needs rclpy)."""

import math
import queue
import threading
import time
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from tauguard.findings import ArgumentError
from tauguard.live.stream import Closing, Sample, StreamClosed, add_event

#: Length of the queue of unread samples; further samples are lost and counted.
WAITING = 1000


def sample_of(message: Any, names: Sequence[str], arrived: int) -> Sample:
    """Convert a JointState to a sample; its joints are found by name.

    Raises:
        ArgumentError: the message lacks a joint, velocities or efforts.
    """
    order = list(message.name)
    if missing := [name for name in names if name not in order]:
        raise ArgumentError(f"JointState: no {', '.join(missing)}; it has {', '.join(order)}")
    rows = [order.index(name) for name in names]
    signals = (message.position, message.velocity, message.effort)
    for what, signal in zip(("position", "velocity", "effort"), signals, strict=True):
        if len(signal) != len(order):
            raise ArgumentError(f"JointState: {len(signal)} numbers in {what}, {len(order)} joints")
    stamp = message.header.stamp
    q, qd, effort = (np.array([signal[i] for i in rows], dtype=np.float64) for signal in signals)
    return Sample(stamp.sec + 1e-9 * stamp.nanosec, q, qd, effort, arrived)


class RosStream(Closing):
    """Subscribes to one topic and publishes nothing.

    Args:
        topic: of type sensor_msgs/JointState.
        joint_names: joints to read.
        rate: expected sample rate [Hz].

    Raises:
        ArgumentError: rclpy is not installed.
    """

    def __init__(self, topic: str, joint_names: Sequence[str], rate: float) -> None:
        """Subscribe."""
        try:
            # rclpy is no dependency: it comes with ROS 2, not from a package index.
            rclpy: Any = import_module("rclpy")
            executors: Any = import_module("rclpy.executors")
            qos: Any = import_module("rclpy.qos")
            kind: Any = import_module("sensor_msgs.msg").JointState
        except ImportError as error:
            raise ArgumentError(
                f'`ros="{topic}"`: {error}; source a ROS 2 installation first, or pipe the topic '
                "into `stdin=True`"
            ) from None
        self.joint_names, self.rate = tuple(joint_names), rate
        self.events: list[str] = []
        self._waiting: queue.Queue[Sample | ValueError] = queue.Queue(WAITING)
        self._lost, self._last = 0, math.nan
        self._context = rclpy.Context()
        self._context.init()
        self._node = rclpy.create_node("tauguard_listen", context=self._context)
        self._node.create_subscription(kind, topic, self._on_message, qos.qos_profile_sensor_data)
        self._executor = executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        threading.Thread(target=self._executor.spin, daemon=True).start()

    def _on_message(self, message: Any) -> None:
        """Queue the sample of a message; the executor calls this in its own thread."""
        try:
            found: Sample | ValueError = sample_of(message, self.joint_names, time.monotonic_ns())
        except ValueError as error:
            found = error
        try:
            self._waiting.put_nowait(found)
        except queue.Full:
            self._lost += 1
            if self._lost == 1:
                add_event(self.events, "samples are lost: they come faster than they are read")

    def read(self, timeout: float) -> Sample | None:
        """The next sample, or None if none came within ``timeout`` seconds.

        Raises:
            StreamClosed: ROS has been shut down.
            ArgumentError: a message without the joints, velocities or efforts.
        """
        try:
            found = self._waiting.get(timeout=timeout)
        except queue.Empty:
            if not self._context.ok():
                raise StreamClosed("ROS has been shut down") from None
            return None
        if isinstance(found, ValueError):
            raise found
        passed, self._last = found.t - self._last, found.t
        if passed * self.rate > 1.5:
            lost = round(passed * self.rate) - 1
            add_event(self.events, f"{lost} samples lost before {found.t:.3f}")
        return found

    def close(self) -> None:
        """Unsubscribe from the topic."""
        if self._context.ok():
            self._executor.shutdown()
            self._node.destroy_node()
            self._context.shutdown()
