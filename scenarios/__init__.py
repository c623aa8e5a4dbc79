"""One question, one file: every file here holds one `Scenario`, found by scanning this folder."""

if __name__ != "hqp_rp.scenarios":
    raise ImportError("import hqp_rp.scenarios, not scenarios")
