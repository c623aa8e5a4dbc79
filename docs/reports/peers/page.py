def write(run, output):
    pass
