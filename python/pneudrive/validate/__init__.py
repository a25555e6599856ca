"""Validation of drives against measurements: free runs, metrics, verdicts and diagnosis of residuals."""

from __future__ import annotations

from pneudrive.validate.diagnosis import Culprit, Diagnosis, diagnose
from pneudrive.validate.validation import RecordResult, Validation, Verdict, validate

__all__ = ["Culprit", "Diagnosis", "RecordResult", "Validation", "Verdict", "diagnose", "validate"]
