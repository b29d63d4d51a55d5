"""Models: scikit-learn pipelines by task, with the settings that are fixed for them."""
