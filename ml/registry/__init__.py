"""Models as files: what they may hold, what is known of each, which one serves, and what served before.

archive.py    a model's state as bytes that cannot run anything; sound.py: trees that can be followed
card.py       model.json; code.py: the hash of the features' code; judged.py: how good it was
registry.py   the models of a store: publish, load, promote, roll back
pointers.py   which one serves, as a history that nobody can overwrite
onnx.py       models for other programs; onnx_nodes.py: what its converter does not know
"""
