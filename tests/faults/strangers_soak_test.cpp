// Honest clients beside strangers who take all they can get: in turn with them and without. None of
// their requests may fail; how late the answers come is printed. ISOMESH_SOAK_SECONDS says for how
// long (tests/soak sets it).
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <deque>
#include <functional>
#include <iostream>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "base/niceness.h"
#include "server/net/descriptors.h"
#include "tests/faults/fixture.h"

namespace isomesh {
namespace {

using namespace test;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
using std::chrono::seconds;

// Who comes without a token is told apart by the address.
constexpr const char* kStranger = "127.0.0.2";
constexpr const char* kSilentStranger = "127.0.0.3";

// Their own work would be done by their own machines: here it gets what the daemon leaves.
constexpr int kStrangersNiceness = 19;

struct Kind {
  const char* name;
  std::function<Answer()> act;
  std::vector<double> calm_ms = {};
  std::vector<double> disturbed_ms = {};
};

double percentile(std::vector<double> values, double share) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

class StrangersSoak : public FaultTest {
 protected:
  static std::optional<seconds> asked_duration() {
    const char* asked = std::getenv("ISOMESH_SOAK_SECONDS");
    if (asked == nullptr) return std::nullopt;
    return seconds(std::stol(asked));
  }

  // One attack of a stranger, who repeats it. Takes some seconds at most.
  using Deed = std::function<void(const std::stop_token& stop)>;

  // Some bytes a second are enough to go on.
  void upload_slowly(const std::stop_token& stop) {
    const std::string begin =
        "POST /v1/volumes?dims=1000,100,100&type=uint8 HTTP/1.1\r\nHost: localhost\r\n"
        "Content-Length: 10000000\r\n\r\n";
    std::deque<Connection> uploads;
    for (int n = 0; n < 8; ++n) uploads.emplace_back(daemon().url(), kStranger).send(begin);
    for (int round = 0; round < 50 && !stop.stop_requested(); ++round) {
      for (const Connection& one : uploads) one.send(std::string(4096, 'x'));
      std::this_thread::sleep_for(milliseconds(100));
    }
  }

  // Follows the events of a job that runs long enough.
  void follow_events(const std::stop_token& stop) {
    const std::string id = submit(daemon(), long_, 50, "\"passes\": 1000").id;
    hold(256, request("GET", "/v1/jobs/" + id + "/events"), kStranger, stop);
    daemon().client().cancel(id);
  }

  void say_nothing(const std::stop_token& stop) { hold(1100, "", kSilentStranger, stop); }

  void hold(int count, const std::string& bytes, const char* from, const std::stop_token& stop) {
    std::deque<Connection> connections;
    for (int n = 0; n < count && !stop.stop_requested(); ++n) {
      connections.emplace_back(daemon().url(), from).send(bytes);
    }
    for (int round = 0; round < 50 && !stop.stop_requested(); ++round) {
      std::this_thread::sleep_for(milliseconds(100));
    }
  }

  void send_nonsense() {
    const Connection connection(daemon().url(), kStranger);
    connection.send("GET /\x01 HTTP/9.9\r\nHost\r\n\r\n");
    std::this_thread::sleep_for(milliseconds(5));
  }

  void ask(const std::string& target) {
    answer_to(daemon().url(), request("GET", target), kStranger);
  }

  std::vector<Deed> deeds() {
    std::vector<Deed> all = {[this](const auto& stop) { upload_slowly(stop); },
                             [this](const auto& stop) { follow_events(stop); },
                             [this](const auto& stop) { say_nothing(stop); },
                             [this](const auto&) { send_nonsense(); }};
    for (int n = 0; n < 8; ++n) {
      all.push_back([this](const auto&) { ask("/v1/jobs?limit=1000"); });
    }
    for (int n = 0; n < 2; ++n) {
      all.push_back([this, n](const auto&) {
        ask("/v1/volumes/" + blank_ + "/slice.png?axis=z&index=" + std::to_string(n));
      });
    }
    return all;
  }

  // A client that connects again where its connection was refused has lost nothing.
  static void try_again(const Deed& deed, const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      try {
        deed(stop);
      } catch (const std::runtime_error&) {
        std::this_thread::sleep_for(milliseconds(10));
      }
    }
  }

  // For those who list them.
  void make_jobs(int count) {
    const Volume volume = small_volume();
    std::string last;
    for (int n = 0; n < count; ++n) last = submit(daemon(), volume, 60 + 0.05 * n).id;
    ASSERT_TRUE(is_final(ended(last).state));
  }

  std::vector<Kind> kinds() {
    const Job made = job(job_);
    return {{"status", [this] { return daemon().get("/v1/jobs/" + job_); }},
            {"upload", [this] { return upload_another(); }},
            {"download", [this, href = made.mesh->files.at(MeshFormat::kDrc).href] {
               return daemon().get(href);
             }}};
  }

  Answer upload_another() {
    RawUpload raw = sphere_upload();
    raw.bytes.replace(0, 4, std::string(4, static_cast<char>(1 + uploads_ % 255)));
    raw.bytes[4] = static_cast<char>(uploads_++ / 255 % 255);
    return daemon().send("POST", "/v1/volumes?" + raw.query, raw.bytes);
  }

  // All kinds in turn for so long.
  static void serve(std::vector<Kind>& kinds, seconds length, std::vector<double> Kind::*times) {
    const auto end = Clock::now() + length;
    do {
      for (Kind& kind : kinds) {
        const auto begin = Clock::now();
        const Answer answer = kind.act();
        (kind.*times)
            .push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
        ASSERT_TRUE(answer.status == 200 || answer.status == 201)
            << kind.name << ": " << answer.status << ' ' << answer.body;
      }
    } while (Clock::now() < end);
  }

  void serve_beside_strangers(std::vector<Kind>& kinds, seconds length) {
    std::vector<std::jthread> strangers;
    for (const Deed& deed : deeds()) {
      strangers.emplace_back([deed](const std::stop_token& stop) {
        be_nicer(kStrangersNiceness);
        try_again(deed, stop);
      });
    }
    serve(kinds, length, &Kind::disturbed_ms);
  }

  std::string job_;  // of an honest client, and finished
  Volume long_;
  std::string blank_;  // a volume whose slices are large
  int uploads_ = 0;
};

TEST_F(StrangersSoak, HonestClientsAreServedBesideStrangers) {
  be_prompt();                    // as an honest client's own machine would be
  net::raise_descriptor_limit();  // the strangers' connections are this process's
  start({"--log-level", "error"});
  job_ = finished_job(daemon()).id;
  const SampleVolume<std::uint8_t> blank = {
      .samples = std::vector<std::uint8_t>(18'000'000), .dims = {3000, 3000, 2}, .geometry = {}};
  long_ = upload(daemon(), long_upload());
  blank_ = upload(daemon(), raw_upload(blank)).id;
  const std::optional<seconds> asked = asked_duration();
  const seconds phase = asked.value_or(seconds(4)) / 4;
  make_jobs(asked ? 1000 : 20);
  std::vector<Kind> kinds = this->kinds();
  for (int turn = 0; turn < 2; ++turn) {
    serve(kinds, phase, &Kind::calm_ms);
    if (HasFatalFailure()) return;
    serve_beside_strangers(kinds, phase);
    if (HasFatalFailure()) return;
  }
  for (const Kind& kind : kinds) {
    const double calm = percentile(kind.calm_ms, 0.99);
    const double disturbed = percentile(kind.disturbed_ms, 0.99);
    std::cout << kind.name << ": p50 " << percentile(kind.calm_ms, 0.5) << " and "
              << percentile(kind.disturbed_ms, 0.5) << " ms, p99 " << calm << " and " << disturbed
              << " ms without and with strangers, of " << kind.calm_ms.size() << " and "
              << kind.disturbed_ms.size() << std::endl;
  }
}

}  // namespace
}  // namespace isomesh
