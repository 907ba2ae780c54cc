"""Demonstrations: recorded episodes of people and policies, exact replay, and learning from them.

``recording`` holds the steps of an episode, ``files`` keeps it in a folder, ``events`` are what people did to the
world, and ``replay`` plays all of it again.
"""
