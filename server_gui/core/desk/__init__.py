"""What the window knows, without Qt: a `Desk` of `Station`s, one a robot. For the window's thread.

rings: the past of every channel · walk: gait phase · soles: where cells are · stopping · control: the lease ·
edits, writing: changes staged, reviewed, written, tried, taken back · watch, news: what happened ·
commands, link: what is asked of a robot, over a link of its own · predictions: what models say ·
station · desk
"""
