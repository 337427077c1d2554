"""Logs of flight controllers: PX4 ULog and ArduPilot DataFlash."""
