"""Hardening: spoilt inputs, kills, full disks; every case accepted, or refused with a reason."""
