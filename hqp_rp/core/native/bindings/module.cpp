#define HQP_IMPORTS_NUMPY
#include "objects.hpp"

namespace {
int import_numpy() {
  import_array1(-1);
  return 0;
}
}  // namespace

NB_MODULE(_native, module) {
  module.doc() = "The native core of hqp_rp: closed forms, active set, saturation, rows of tasks and batches, compiled from C++.";
  nb::set_leak_warnings(false);  // classes registered from Python live as long as the process
  if (import_numpy() < 0) throw nb::python_error();
  hqp::python::bind_objects(module);
  hqp::python::bind_closed_forms(module);
  hqp::python::bind_active_set(module);
  hqp::python::bind_qp_cascade(module);
  hqp::python::bind_task_rows(module);
  hqp::python::bind_torque_rows(module);
  hqp::python::bind_saturation(module);
}
