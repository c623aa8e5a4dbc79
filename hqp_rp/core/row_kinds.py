"""How the kinds of native task rows are numbered (`RowItem::Kind` of the native core)."""

FRAME, TWIST, POSTURE, RELATIVE, POINTING, BOX = range(6)
