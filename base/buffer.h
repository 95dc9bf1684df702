// Aligned, move-only storage for planes: no element is initialised unless asked for, none is copied by accident.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

namespace fathom {

// `size` elements aligned to 64 bytes, followed by 64 readable bytes, so that a vector load that starts inside never
// faults.
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Buffer() = default;
  explicit Buffer(size_t size) : data_(allocate(size)), size_(size) {}
  Buffer(size_t size, T value) : Buffer(size) { fill(value); }
  Buffer(Buffer&& other) noexcept : data_(std::move(other.data_)), size_(std::exchange(other.size_, 0)) {}
  Buffer& operator=(Buffer&& other) noexcept {
    data_ = std::move(other.data_);
    size_ = std::exchange(other.size_, 0);
    return *this;
  }

  Buffer copy() const {
    Buffer result(size_);
    std::copy_n(data(), size_, result.data());
    return result;
  }
  void fill(T value) { std::fill_n(data(), size_, value); }

  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T& operator[](size_t i) { return data_.get()[i]; }
  const T& operator[](size_t i) const { return data_.get()[i]; }
  T* begin() { return data(); }
  T* end() { return data() + size_; }
  const T* begin() const { return data(); }
  const T* end() const { return data() + size_; }
  operator std::span<T>() { return {data(), size_}; }
  operator std::span<const T>() const { return {data(), size_}; }

 private:
  struct Free {
    void operator()(T* p) const { std::free(p); }
  };
  static std::unique_ptr<T[], Free> allocate(size_t size) {
    constexpr size_t kAlign = 64;
    if (size > (size_t(1) << 56) / sizeof(T)) throw std::bad_alloc();
    const size_t bytes = (size * sizeof(T) + 2 * kAlign - 1) / kAlign * kAlign;
    void* p = std::aligned_alloc(kAlign, bytes);
    if (!p) throw std::bad_alloc();
    // The padding is read by vector loads and its value never used; zero keeps it finite and the sanitizers quiet.
    std::fill_n(static_cast<char*>(p) + size * sizeof(T), bytes - size * sizeof(T), char(0));
    return std::unique_ptr<T[], Free>(static_cast<T*>(p));
  }

  std::unique_ptr<T[], Free> data_;
  size_t size_ = 0;
};

}  // namespace fathom
