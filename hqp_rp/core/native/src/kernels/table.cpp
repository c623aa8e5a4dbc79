#include "table.hpp"

namespace hqp {
inline namespace HQP_ISA {

#define HQP_TEXT_OF(name) #name
#define HQP_TEXT(name) HQP_TEXT_OF(name)

extern const Kernels table;
const Kernels table{
    .instruction_set = HQP_TEXT(HQP_ISA),
    .null_space = call_null_space,
    .reverse_priority = call_reverse_priority,
    .active_set = call_active_set,
    .proven_optimal = call_proven_optimal,
    .make_qp_cascade = make_qp_cascade,
    .polish = call_polish,
    .serial_arm = call_serial_arm,
    .saturation = call_saturation,
    .damped_least_squares = call_damped_least_squares,
    .null_space_batch = call_null_space_batch,
    .reverse_priority_batch = call_reverse_priority_batch,
};

}  // namespace HQP_ISA
}  // namespace hqp
