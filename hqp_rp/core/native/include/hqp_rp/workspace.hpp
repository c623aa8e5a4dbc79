// Working memory of a solve: blocks that are kept, so that nothing is allocated after the first solve of its size.
#pragma once

#include <cstddef>
#include <cstdint>

namespace hqp {

// A stack of arrays, each aligned to a cache line. Not to be shared between threads.
class Workspace {
 public:
  Workspace() = default;
  ~Workspace();
  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;

  // Uninitialized arrays that live until the enclosing `Scope` ends.
  double* numbers(std::size_t count) { return static_cast<double*>(take(count * sizeof(double))); }
  int* counts(std::size_t count) { return static_cast<int*>(take(count * sizeof(int))); }

  // Makes sure that so many bytes can be taken from here on without another block; kernels ask for the most that a problem of
  // their size can need, so that a singular problem in a loop allocates no more than the regular ones before it.
  void reserve(std::size_t bytes) {
    if (current_ < 0 ? count_ == 0 || blocks_[count_ - 1].size < bytes : blocks_[current_].size - used_ < bytes && !room_after(bytes))
      allocate(bytes);
  }

  // How many blocks have been allocated so far: a loop over problems of one size must not change it.
  int allocations() const { return count_; }

  // Gives back what was taken since it was made.
  class Scope {
   public:
    explicit Scope(Workspace& workspace) : workspace_(workspace), current_(workspace.current_), used_(workspace.used_) {}
    ~Scope() {
      workspace_.current_ = current_;
      workspace_.used_ = used_;
    }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    Workspace& workspace_;
    int current_;
    std::size_t used_;
  };

 private:
  struct Block {
    unsigned char* data;
    std::size_t size;
  };

  void* take(std::size_t bytes) {
    bytes = (bytes + 63) / 64 * 64;
    if (current_ < 0 || used_ + bytes > blocks_[current_].size) return take_elsewhere(bytes);
    void* found = blocks_[current_].data + used_;
    used_ += bytes;
    return found;
  }
  void* take_elsewhere(std::size_t bytes);
  void allocate(std::size_t bytes);
  bool room_after(std::size_t bytes) const { return current_ < count_ - 1 && blocks_[count_ - 1].size >= bytes; }

  Block blocks_[48] = {};  // each larger than all before it together
  int count_ = 0;
  int current_ = -1;
  std::size_t used_ = 0;
};

}  // namespace hqp
