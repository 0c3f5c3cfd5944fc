"""placeholder"""


def newton_solutions(*a):
    raise NotImplementedError
