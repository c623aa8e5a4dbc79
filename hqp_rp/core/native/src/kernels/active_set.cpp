#include "hqp_rp/active_set.hpp"

#include "table.hpp"

namespace hqp {
inline namespace HQP_ISA {

Outcome call_active_set(ActiveSetCall& call, Workspace& workspace) {
  Problem shape = *call.problem;
  shape.rows = ActiveSetSearch<int>::rows_of(*call.problem, call.damped) - shape.hard_rows;
  shape.levels += shape.levels;
  workspace.reserve(room(shape, 8));
  return with_width(call.problem->unknowns, [&](auto width) {
    Workspace::Scope scope(workspace);
    ActiveSetSearch search(*call.problem, call.damped, call.rank_tolerance, call.limit, workspace, width);
    const Outcome outcome = search.solve(call.z, call.least_violation, call.x, call.side, call.guessed);
    call.iterations = search.iterations;
    call.delicate = search.smallest < tolerance::delicate_warm || search.smallest_held < tolerance::delicate_warm;
    return outcome;
  });
}

}  // namespace HQP_ISA
}  // namespace hqp
