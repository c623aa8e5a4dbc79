"""One method, one file: every file here holds one `hqp_rp.Solver`, found by scanning this folder."""

if __name__ != "hqp_rp.solvers":
    raise ImportError("import hqp_rp.solvers, not solvers")
