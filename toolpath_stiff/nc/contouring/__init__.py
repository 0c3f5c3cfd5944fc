"""What contouring controls with words of their own share: points and poles, contours, tilted planes."""
