"""UniMoGen without a server: ways to answer windows, figures, style, the pack's card."""
