#include "libeditnerf/base/parallel.h"

#include <ATen/Parallel.h>
#include <dlfcn.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace editnerf {
namespace {

thread_local bool t_inside = false;

struct Job {
  const std::function<void(int64_t, int64_t)>* body = nullptr;
  int64_t count = 0, chunk = 1;
  std::atomic<int64_t> next{0};
  std::mutex error_mutex;
  std::exception_ptr error;

  void Work() {
    t_inside = true;
    for (;;) {
      const int64_t begin = next.fetch_add(chunk);
      if (begin >= count) break;
      try {
        (*body)(begin, std::min(count, begin + chunk));
      } catch (...) {
        const std::lock_guard<std::mutex> lock(error_mutex);
        if (!error) error = std::current_exception();
        next = count;
      }
    }
    t_inside = false;
  }
};

// Workers that sleep between jobs; the calling thread works too.
class Pool {
 public:
  explicit Pool(int64_t num_workers) {
    for (int64_t i = 0; i < num_workers; ++i) workers_.emplace_back([this] { Loop(); });
  }
  ~Pool() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    for (std::thread& worker : workers_) worker.join();
  }

  void Run(Job& job) {
    const std::lock_guard<std::mutex> one_caller(caller_mutex_);
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      job_ = &job;
      ++generation_;
      busy_ = static_cast<int64_t>(workers_.size());
    }
    wake_.notify_all();
    job.Work();
    std::unique_lock<std::mutex> lock(mutex_);
    done_.wait(lock, [this] { return busy_ == 0; });
  }

 private:
  void Loop() {
    int64_t seen = 0;
    for (;;) {
      Job* job;
      {
        std::unique_lock<std::mutex> lock(mutex_);
        wake_.wait(lock, [&] { return stop_ || generation_ != seen; });
        if (stop_) return;
        seen = generation_;
        job = job_;
      }
      job->Work();
      const std::lock_guard<std::mutex> lock(mutex_);
      if (--busy_ == 0) done_.notify_one();
    }
  }

  std::vector<std::thread> workers_;
  std::mutex caller_mutex_, mutex_;
  std::condition_variable wake_, done_;
  Job* job_ = nullptr;
  int64_t generation_ = 0, busy_ = 0;
  bool stop_ = false;
};

int64_t AvailableCores() {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof(set), &set) == 0) return std::max(1, CPU_COUNT(&set));
  return std::max(1u, std::thread::hardware_concurrency());
}

int64_t g_num_threads = 0;
// Never destroyed: at the end of the process its threads may still be starting, and joining them there can wait for
// ever.
Pool* g_pool = nullptr;

// OpenBLAS, where it is the BLAS under LibTorch, has a pool and a number of threads of its own.
void SetBlasThreads(int64_t count) {
  using SetThreads = void (*)(int);
  static const auto set = reinterpret_cast<SetThreads>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"));
  if (set != nullptr) set(static_cast<int>(count));
}

// LibTorch and OpenBLAS with one thread in the calling thread, until it goes.
class SerialOperations {
 public:
  SerialOperations() {
    at::set_num_threads(1);
    SetBlasThreads(1);
  }
  ~SerialOperations() {
    at::set_num_threads(static_cast<int>(NumThreads()));
    SetBlasThreads(NumThreads());
  }
  SerialOperations(const SerialOperations&) = delete;
  SerialOperations& operator=(const SerialOperations&) = delete;
};

}  // namespace

void SetNumThreads(int64_t count) {
  g_num_threads = count > 0 ? count : AvailableCores();
  SetBlasThreads(g_num_threads);
  delete g_pool;
  g_pool = g_num_threads > 1 ? new Pool(g_num_threads - 1) : nullptr;
  at::set_num_threads(static_cast<int>(g_num_threads));
}

int64_t NumThreads() {
  if (g_num_threads == 0) SetNumThreads(0);
  return g_num_threads;
}

void ParallelFor(int64_t count, int64_t grain, const std::function<void(int64_t, int64_t)>& body) {
  if (count <= 0) return;
  const int64_t threads = NumThreads();
  if (t_inside || threads == 1 || count <= grain) {
    body(0, count);
    return;
  }
  Job job;
  job.body = &body;
  job.count = count;
  // A few chunks per thread even out chunks of unequal cost.
  job.chunk = std::max(grain, (count + 4 * threads - 1) / (4 * threads));
  g_pool->Run(job);
  if (job.error) std::rethrow_exception(job.error);
}

void ParallelParts(int64_t count, const std::function<void(int64_t)>& body) {
  const auto each = [&](int64_t begin, int64_t end) {
    if (at::get_num_threads() != 1 && t_inside) at::set_num_threads(1);  // LibTorch's number is each thread's own
    for (int64_t i = begin; i < end; ++i) body(i);
  };
  if (t_inside || NumThreads() == 1 || count <= 1) return each(0, count);
  const SerialOperations serial;
  Job job;
  const std::function<void(int64_t, int64_t)> work = each;
  job.body = &work;
  job.count = count;
  g_pool->Run(job);
  if (job.error) std::rethrow_exception(job.error);
}

}  // namespace editnerf
