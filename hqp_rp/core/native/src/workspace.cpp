#include "hqp_rp/workspace.hpp"

#include <algorithm>
#include <new>

namespace hqp {

namespace {
constexpr std::align_val_t line{64};
constexpr std::size_t smallest_block = 32768;
}  // namespace

void* Workspace::take_elsewhere(std::size_t bytes) {
  while (++current_ < count_) {
    if (blocks_[current_].size >= bytes) {
      used_ = bytes;
      return blocks_[current_].data;
    }
  }
  allocate(2 * bytes);
  current_ = count_ - 1;
  used_ = bytes;
  return blocks_[current_].data;
}

void Workspace::allocate(std::size_t bytes) {
  std::size_t total = 0;
  for (int i = 0; i < count_; ++i) total += blocks_[i].size;
  const std::size_t size = std::max({(bytes + 63) / 64 * 64, 2 * total, smallest_block});
  blocks_[count_] = {static_cast<unsigned char*>(::operator new(size, line)), size};
  ++count_;
}

Workspace::~Workspace() {
  for (int i = 0; i < count_; ++i) ::operator delete(blocks_[i].data, line);
}

}  // namespace hqp
