// Mixed load for some time: what the daemon takes must level off. ISOMESH_SOAK_SECONDS says for how
// long (tests/soak sets it).
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "tests/faults/fixture.h"

namespace isomesh {
namespace {

using namespace test;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::uint64_t kMiB = 1 << 20;
constexpr std::uint64_t kMaxDisk = 16 * kMiB;
#ifdef __SANITIZE_ADDRESS__
constexpr std::uint64_t kMemorySlack =
    400 * kMiB;  // what the sanitizer holds back after it is freed
#else
constexpr std::uint64_t kMemorySlack = 16 * kMiB;
#endif

struct Sample {
  std::uint64_t memory_bytes = 0;
  std::uint64_t threads = 0;
  std::uint64_t descriptors = 0;
  std::uint64_t disk_bytes = 0;
};

class Soak : public FaultTest {
 protected:
  static seconds duration() {
    const char* asked = std::getenv("ISOMESH_SOAK_SECONDS");
    return seconds(asked == nullptr ? 8 : std::stol(asked));
  }

  Sample look() {
    Sample sample;
    std::set<pid_t> processes = job_processes();
    processes.insert(daemon().pid());
    for (const pid_t process : processes) add("/proc/" + std::to_string(process), sample);
    std::error_code gone;
    for (std::filesystem::recursive_directory_iterator entry(folder_ / "data", gone), end;
         entry != end; entry.increment(gone)) {
      std::error_code absent;
      const auto bytes = entry->is_regular_file(absent) ? entry->file_size(absent) : 0;
      if (!absent) sample.disk_bytes += bytes;
    }
    return sample;
  }

  // The memory, threads and descriptors of a process, by its folder in /proc.
  static void add(const std::string& process, Sample& sample) {
    std::ifstream status(process + "/status");
    for (std::string line; std::getline(status, line);) {
      const auto number = [&] { return std::stoull(line.substr(line.find(':') + 1)); };
      if (line.starts_with("VmRSS:")) sample.memory_bytes += number() * 1024;
      if (line.starts_with("Threads:")) sample.threads += number();
    }
    std::error_code gone;
    for ([[maybe_unused]] const auto& entry :
         std::filesystem::directory_iterator(process + "/fd", gone)) {
      ++sample.descriptors;
    }
  }

  // One request of a client of each kind. Refusals are part of the load.
  void act(std::mt19937& random) {
    const auto one_of = [&](int count) {
      return std::uniform_int_distribution(0, count - 1)(random);
    };
    const Field ball = scaled(sphere({12.2, 11.7, 12.1}, 5 + 0.01 * one_of(500)), 12, 100);
    const RawUpload raw = raw_upload(sample<std::uint8_t>(ball, {24, 24, 24}));
    const Answer uploaded = daemon().send("POST", "/v1/volumes?" + raw.query, raw.bytes);
    if (uploaded.status != 201 && uploaded.status != 200) return;
    const Volume volume = volume_from_json(uploaded.body);
    const Answer answer = daemon().send("POST", "/v1/jobs", job_body(volume.id, 80 + one_of(40)));
    if (answer.status != 202) return;
    const std::string path = "/v1/jobs/" + job_from_json(answer.body).id;
    switch (one_of(5)) {
      case 0:
        daemon().send("DELETE", path);
        break;
      case 1:
        daemon().get("/v1/jobs");
        break;
      case 2:
        daemon().send("DELETE", "/v1/volumes/" + volume.id);
        break;
      default:
        daemon().get(path + "?wait=10");
        daemon().get(path + "/mesh.drc");
    }
  }

  static std::uint64_t most(std::vector<Sample>::const_iterator begin,
                            std::vector<Sample>::const_iterator end,
                            std::uint64_t Sample::*member) {
    std::uint64_t result = 0;
    for (auto sample = begin; sample != end; ++sample) {
      result = std::max(result, (*sample).*member);
    }
    return result;
  }

  static void tell(const Sample& sample) {
    std::cout << sample.memory_bytes / kMiB << " MiB, " << sample.threads << " threads, "
              << sample.descriptors << " descriptors, " << sample.disk_bytes / kMiB
              << " MiB on disk" << std::endl;
  }
};

TEST_F(Soak, MemoryThreadsDescriptorsAndDiskLevelOff) {
  start({"--max-disk", std::to_string(kMaxDisk), "--log-level", "error"});
  const auto end = std::chrono::steady_clock::now() + duration();
  constexpr std::size_t kFewestSamples = 30;
  constexpr std::uint64_t kFewestActs = 300;  // however long that takes on a busy machine
  std::atomic<bool> is_over = false;
  std::atomic<std::uint64_t> acts = 0;
  std::vector<Sample> samples;
  {
    std::vector<std::jthread> clients;
    for (unsigned client = 0; client < 4; ++client) {
      clients.emplace_back([&, client] {
        std::mt19937 random(client);
        while (!is_over) {
          act(random);
          ++acts;
        }
      });
    }
    const auto between = std::max(milliseconds(duration()) / 60, milliseconds(100));
    while (std::chrono::steady_clock::now() < end || samples.size() < kFewestSamples ||
           acts < kFewestActs) {
      std::this_thread::sleep_for(between);
      samples.push_back(look());
      if (samples.size() % 10 == 0) tell(samples.back());
    }
    is_over = true;
  }
  std::cout << acts << " rounds of requests" << std::endl;
  const auto third = static_cast<std::ptrdiff_t>(samples.size() / 3);
  const auto early = [&](auto member) {
    return most(samples.begin() + third, samples.begin() + 2 * third, member);
  };
  const auto late = [&](auto member) {
    return most(samples.begin() + 2 * third, samples.end(), member);
  };
  EXPECT_LE(late(&Sample::memory_bytes), early(&Sample::memory_bytes) * 5 / 4 + kMemorySlack);
  EXPECT_LE(late(&Sample::threads), early(&Sample::threads) + 2);
  EXPECT_LE(late(&Sample::descriptors), early(&Sample::descriptors) + 40);
  // Beside the blobs there are the database, its log and what is under way.
  EXPECT_LE(late(&Sample::disk_bytes),
            std::max(early(&Sample::disk_bytes) * 5 / 4, kMaxDisk) + 16 * kMiB);
}

}  // namespace
}  // namespace isomesh
