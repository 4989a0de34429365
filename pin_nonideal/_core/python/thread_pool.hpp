// Parallel loop over threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "python/arrays.hpp"

namespace pn {

inline int useful_threads(size_t count, int threads) { return static_cast<int>(std::min<size_t>(threads, count)); }

// Call work(i, k) for every i below `count`, drawn from one counter by threads k. Thread 0 is the caller's. An
// exception of a thread, or a Python signal, stops the loop and is thrown at the end.
template <class Work>
void parallel_for(size_t count, int threads, std::atomic<bool>& stopped, Work work) {
    nb::gil_scoped_release release;
    std::atomic<size_t> next{0};
    std::mutex mutex;
    std::condition_variable thread_ended;
    int running = 0;
    std::exception_ptr error;
    const auto keep = [&](const std::exception_ptr& thrown) {
        const std::lock_guard<std::mutex> guard(mutex);
        if (!error) error = thrown;
        stopped = true;
    };
    const auto draw = [&](int k) {
        try {
            for (size_t i = next++; i < count && !stopped; i = next++) work(i, k);
        } catch (...) {
            keep(std::current_exception());
        }
    };
    const auto follow = [&](int k) {
        draw(k);
        const std::lock_guard<std::mutex> guard(mutex);
        --running;
        thread_ended.notify_one();
    };
    const int useful = useful_threads(count, threads);
    std::vector<std::thread> pool;
    pool.reserve(useful);
    for (int k = 1; k < useful; ++k) {
        std::unique_lock<std::mutex> guard(mutex);
        try {
            pool.emplace_back(follow, k);
        } catch (const std::system_error&) {
            break;  // fewer threads do the same work
        }
        ++running;
    }
    draw(0);
    std::unique_lock<std::mutex> guard(mutex);
    while (!thread_ended.wait_for(guard, std::chrono::milliseconds(50), [&] { return running == 0; })) {
        guard.unlock();
        {
            nb::gil_scoped_acquire gil;
            if (PyErr_CheckSignals() != 0) keep(std::make_exception_ptr(nb::python_error()));
        }
        guard.lock();
    }
    guard.unlock();
    for (std::thread& thread : pool) thread.join();
    if (error) std::rethrow_exception(error);
}

}  // namespace pn
