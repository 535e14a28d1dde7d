"""Networks; file names mirror the Rust modules under src/."""
