"""One module a framework. Each has `VARIANTS` (name: what is set), `prepare(folder, nets, variant)` which makes its files once, and
`open(folder, variant, threads, stream)` which gives the two networks to a `Stream`."""
