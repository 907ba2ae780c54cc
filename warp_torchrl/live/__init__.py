"""A live page: watch a team fight a fire in three dimensions, and take its vehicles over.

``match`` plays one fire, ``crew`` says who moves each vehicle, ``drawing`` makes the arrays that are drawn; none of
them knows of a browser. ``page``, ``stage`` and the package ``panel`` put them on a page with viser (extra ``live``).
"""
