"""Where the model fails: errors, structure in residuals, checks without a model."""
