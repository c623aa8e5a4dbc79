// numpy arrays by numpy's own interface: a solve makes and reads a few of them, and each nanosecond shows.
#pragma once

#include <nanobind/nanobind.h>

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define PY_ARRAY_UNIQUE_SYMBOL hqp_rp_numpy
#ifndef HQP_IMPORTS_NUMPY
#define NO_IMPORT_ARRAY
#endif
#include <numpy/arrayobject.h>

namespace nb = nanobind;

namespace hqp::python {

// The data of a C-contiguous, aligned array of that type and number of axes, or null. An array counts whether writable or not.
inline void* data_of(PyObject* object, int type, int axes) {
  if (!PyArray_Check(object)) return nullptr;
  auto* array = reinterpret_cast<PyArrayObject*>(object);
  if (PyArray_TYPE(array) != type || PyArray_NDIM(array) != axes || !PyArray_ISCARRAY_RO(array)) return nullptr;
  return PyArray_DATA(array);
}

inline Py_ssize_t length_of(PyObject* array, int axis = 0) {
  return PyArray_DIM(reinterpret_cast<PyArrayObject*>(array), axis);
}

// A new, uninitialized array.
inline nb::object new_array(std::initializer_list<npy_intp> shape, int type = NPY_DOUBLE) {
  PyObject* made = PyArray_SimpleNew(static_cast<int>(shape.size()), const_cast<npy_intp*>(shape.begin()), type);
  if (!made) throw nb::python_error();
  return nb::steal(made);
}

inline double* numbers_in(const nb::object& array) {
  return static_cast<double*>(PyArray_DATA(reinterpret_cast<PyArrayObject*>(array.ptr())));
}

// The same numbers as a C-contiguous float64 array, the object itself where it is one; raises where there are none.
inline nb::object as_numbers(nb::handle object) {
  PyObject* found = PyArray_FROMANY(object.ptr(), NPY_DOUBLE, 0, 0, NPY_ARRAY_CARRAY_RO);
  if (!found) throw nb::python_error();
  return nb::steal(found);
}

// A new int8 array of small numbers.
inline nb::object as_int8(const int* from, int n) {
  nb::object made = new_array({n}, NPY_INT8);
  auto* out = static_cast<signed char*>(PyArray_DATA(reinterpret_cast<PyArrayObject*>(made.ptr())));
  for (int i = 0; i < n; ++i) out[i] = static_cast<signed char>(from[i]);
  return made;
}

// Its numbers, or `TypeError` with the name.
template <class T>
const T* required(nb::handle object, int axes, const char* name) {
  void* data = data_of(object.ptr(), sizeof(T) == 8 && std::is_integral_v<T> ? NPY_INT64 : NPY_DOUBLE, axes);
  if (!data) {
    PyErr_Format(PyExc_TypeError, "%s must be a C-contiguous %s array with %d axes.", name, std::is_integral_v<T> ? "int64" : "float64", axes);
    throw nb::python_error();
  }
  return static_cast<const T*>(data);
}

// The secondary vector (n,), or null for None.
inline const double* secondary_in(nb::handle secondary, int n) {
  if (secondary.is_none()) return nullptr;
  const double* z = required<double>(secondary, 1, "secondary");
  if (length_of(secondary.ptr()) != n) throw nb::value_error("secondary does not have one number for each unknown.");
  return z;
}

template <class T>
T* writable(nb::handle object, int axes, const char* name) {
  T* data = const_cast<T*>(required<T>(object, axes, name));
  if (!PyArray_ISWRITEABLE(reinterpret_cast<PyArrayObject*>(object.ptr()))) {
    PyErr_Format(PyExc_TypeError, "%s must be writable.", name);
    throw nb::python_error();
  }
  return data;
}

}  // namespace hqp::python
