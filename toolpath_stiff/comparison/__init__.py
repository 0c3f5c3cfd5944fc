"""Comparison of model and measurements: residuals and their structure."""
