#include "hqp_rp/serial_arm.hpp"

#include "table.hpp"

namespace hqp {
inline namespace HQP_ISA {

void call_serial_arm(const SerialArm& arm, const double* Q, std::int64_t N, int frame, double* rotations, double* origins, double* jacobians,
                     Workspace& workspace) {
  serial_arm(arm, Q, N, frame, rotations, origins, jacobians, workspace);
}

}  // namespace HQP_ISA
}  // namespace hqp
