// The few values made last, by what they were made for. Calls from several threads are safe.
#pragma once

#include <array>
#include <memory>
#include <mutex>

namespace atmos {

template <class Key, class Value>
class Recent {
 public:
  // The value for `key`: an earlier one, or make()'s.
  template <class Make>
  std::shared_ptr<const Value> get(const Key& key, const Make& make) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      for (const Entry& entry : entries_) {
        if (entry.value != nullptr && entry.key == key) return entry.value;
      }
    }
    auto value = std::make_shared<const Value>(make());
    const std::lock_guard<std::mutex> lock(mutex_);
    entries_[next_] = {key, value};
    next_ = (next_ + 1) % entries_.size();
    return value;
  }

 private:
  struct Entry {
    Key key;
    std::shared_ptr<const Value> value;
  };
  std::mutex mutex_;
  std::array<Entry, 4> entries_;
  std::size_t next_ = 0;
};

}  // namespace atmos
