"""Where the model fails: residuals and their structure."""
