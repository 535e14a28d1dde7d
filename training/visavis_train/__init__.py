"""Training of Visavis models: motion features, corpus, networks, training, export."""
