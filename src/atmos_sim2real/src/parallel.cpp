#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>

#include "atmos_sim2real/likelihood.h"

namespace atmos {

namespace {

using Work = std::function<void(std::size_t)>;

// Threads that stay: work comes in batches of a millisecond by the thousand, and a new thread would begin
// with a stack and a heap of its own each time.
class Pool {
 public:
  explicit Pool(std::size_t helpers) {
    for (std::size_t k = 0; k < helpers; ++k) threads_.emplace_back([this] { help(); });
  }

  ~Pool() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      closing_ = true;
    }
    wake_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  // Whether the batch was done; not while another one is, be it the caller's own.
  bool run(std::size_t count, const Work& work) {
    std::unique_lock<std::mutex> lock(mutex_);
    if (work_ != nullptr || threads_.empty()) return false;
    work_ = &work;
    count_ = count;
    next_ = 0;
    failure_ = nullptr;
    wake_.notify_all();
    take(lock);
    done_.wait(lock, [this] { return busy_ == 0; });
    work_ = nullptr;
    if (failure_ != nullptr) std::rethrow_exception(failure_);
    return true;
  }

 private:
  void help() {
    std::unique_lock<std::mutex> lock(mutex_);
    for (;;) {
      wake_.wait(lock, [this] { return closing_ || (work_ != nullptr && next_ < count_); });
      if (closing_) return;
      take(lock);
      if (busy_ == 0) done_.notify_one();
    }
  }

  // Works until nothing of the batch is left.
  void take(std::unique_lock<std::mutex>& lock) {
    ++busy_;
    while (next_ < count_) {
      const std::size_t mine = next_++;
      lock.unlock();
      try {
        (*work_)(mine);
        lock.lock();
      } catch (...) {
        lock.lock();
        failure_ = std::current_exception();
        next_ = count_;
      }
    }
    --busy_;
  }

  std::vector<std::thread> threads_;
  std::mutex mutex_;
  std::condition_variable wake_, done_;
  const Work* work_ = nullptr;  // of the present batch
  std::size_t count_ = 0, next_ = 0, busy_ = 0;
  std::exception_ptr failure_;
  bool closing_ = false;
};

}  // namespace

void in_parallel(std::size_t count, const Work& work) {
  static Pool pool(std::max(1u, std::thread::hardware_concurrency()) - 1);
  if (count > 1 && pool.run(count, work)) return;
  for (std::size_t i = 0; i < count; ++i) work(i);
}

}  // namespace atmos
