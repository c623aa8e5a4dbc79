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
};

}  // namespace HQP_ISA
}  // namespace hqp
