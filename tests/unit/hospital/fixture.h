// Orders against a PACS that does as the test says, by a clock that the test sets.
#pragma once

#include <atomic>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <span>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "base/sha256.h"
#include "server/hospital/orders/orders.h"
#include "server/hospital/orders/received.h"
#include "server/hospital/records/order_store.h"
#include "server/hospital/records/received_store.h"
#include "server/hospital/records/tables.h"
#include "server/store/audit/trail.h"
#include "tests/api/dicom_bytes.h"
#include "tests/support/errors.h"
#include "tests/support/process.h"
#include "tests/support/stores.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::orders {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::minutes;
using std::chrono::seconds;
using test::element;
using testing::ElementsAre;

inline constexpr const char* kStudy = "1.2.1";
inline constexpr const char* kSeries = "1.2.2";
inline constexpr int kSlices = 4;

inline std::string instance_of(int slice) {
  return std::string(kSeries) + '.' + std::to_string(slice);
}

inline std::string slice_file(int slice, const std::string& patient = "PAT-1", int phase = 0) {
  const std::string pixels(std::size_t{4} * 4 * 2, slice % 2 == 0 ? '\1' : '\0');
  return test::dicom(
      element(8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.2") +
      element(8, 0x18, "UI", instance_of(slice + phase * kSlices)) + element(8, 0x60, "CS", "CT") +
      element(0x10, 0x20, "LO", patient) + element(0x20, 0xD, "UI", kStudy) +
      element(0x20, 0xE, "UI", kSeries) + element(0x20, 0x12, "IS", std::to_string(phase + 1)) +
      element(0x20, 0x13, "IS", std::to_string(slice + 7)) +
      element(0x20, 0x32, "DS", "0\\0\\" + std::to_string(slice)) +
      element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0") + element(0x20, 0x52, "UI", "1.9") +
      test::number(0x28, 2, 1) + element(0x28, 4, "CS", "MONOCHROME2") +
      test::number(0x28, 0x10, 4) + test::number(0x28, 0x11, 4) +
      element(0x28, 0x30, "DS", "1\\1") + test::number(0x28, 0x100, 16) +
      test::number(0x28, 0x101, 16) + test::number(0x28, 0x102, 15) + test::number(0x28, 0x103, 0) +
      element(0x7FE0, 0x10, "OW", pixels));
}

// A DICOM segmentation with one segment of that name. Its samples do not depend on the name.
inline std::string segmentation_file(const std::string& name) {
  const std::string first_number("\1\0", 2);
  std::vector<std::string> frames;
  for (int plane = 0; plane < kSlices; ++plane) {
    const std::string place = element(0x20, 0x32, "DS", "0\\0\\" + std::to_string(plane));
    frames.push_back(test::sequence(0x20, 0x9113, {place}) +
                     test::sequence(0x62, 0xA, {element(0x62, 0xB, "US", first_number)}));
  }
  const std::string shared =
      test::sequence(0x20, 0x9116, {element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0")}) +
      test::sequence(0x28, 0x9110,
                     {element(0x18, 0x50, "DS", "1") + element(0x28, 0x30, "DS", "1\\1")});
  const std::string segment = element(0x62, 4, "US", first_number) + element(0x62, 5, "LO", name);
  // The first four bits of each row are set.
  const std::string pixels(std::size_t{8} * kSlices, '\x0F');
  return test::dicom(element(8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.66.4") +
                     element(8, 0x18, "UI", instance_of(0)) + element(8, 0x60, "CS", "SEG") +
                     element(0x10, 0x20, "LO", "PAT-1") + element(0x20, 0xD, "UI", kStudy) +
                     element(0x20, 0xE, "UI", kSeries) + element(0x20, 0x52, "UI", "1.9") +
                     test::number(0x28, 2, 1) + element(0x28, 4, "CS", "MONOCHROME2") +
                     element(0x28, 8, "IS", std::to_string(kSlices)) + test::number(0x28, 0x10, 8) +
                     test::number(0x28, 0x11, 8) + test::number(0x28, 0x100, 1) +
                     test::number(0x28, 0x101, 1) + test::number(0x28, 0x102, 0) +
                     test::number(0x28, 0x103, 0) + element(0x62, 1, "CS", "BINARY") +
                     test::sequence(0x62, 2, {segment}) + test::sequence(0x5200, 0x9229, {shared}) +
                     test::sequence(0x5200, 0x9230, frames) + element(0x7FE0, 0x10, "OB", pixels));
}

// One series, and what was stored.
class FakePacs : public Archive, public ObjectReceiver {
 public:
  std::atomic<bool> is_down = false;
  std::atomic<bool> hangs = false;
  std::atomic<int> retry_after = 0;
  std::atomic<int> calls = 0;
  std::atomic<int> aborted = 0;
  std::atomic<int> stores = 0;
  std::atomic<int> fetches = 0;
  std::atomic<int> sent_slices = kSlices;     // of those that it lists
  std::atomic<int> foreign_slice = -1;        // of another patient
  std::atomic<bool> is_unlisted = false;      // it does not find what it stored
  std::atomic<bool> is_merged = false;        // the study has another Patient ID than its images
  std::function<void()> after_store = [] {};  // set it before there are orders
  std::function<void()> on_fetched;           // called when the images have come

  RecentSeries find_recent(const std::string&, const std::string&,
                           const std::stop_token& stop) override {
    answer(stop);
    return {.series = {{.study = kStudy,
                        .series = kSeries,
                        .modality = "CT",
                        .description = "",
                        .instances = std::nullopt}}};
  }
  std::optional<FoundSeries> find_series(const std::string&, const std::string& series,
                                         const std::stop_token& stop) override {
    answer(stop);
    if (series != kSeries) return std::nullopt;
    return FoundSeries{.study = kStudy,
                       .series = kSeries,
                       .modality = "CT",
                       .description = "",
                       .instances = static_cast<std::uint32_t>(files().size())};
  }
  std::vector<std::string> list_instances(const std::string&, const std::string&,
                                          const std::stop_token& stop) override {
    answer(stop);
    std::vector<std::string> all;
    const auto count = static_cast<int>(files().size());
    for (int slice = 0; slice < count; ++slice) all.push_back(instance_of(slice));
    return all;
  }
  std::string fetch_series(const std::string&, const std::string&,
                           const std::filesystem::path& target,
                           const std::stop_token& stop) override {
    answer(stop);
    ++fetches;
    std::ofstream file(target, std::ios::binary);
    const std::vector<std::string> all = files();
    const std::size_t sent = std::min<std::size_t>(all.size(), sent_slices);
    for (std::size_t n = 0; n < sent; ++n) {
      file << "\r\n--b\r\nContent-Type: application/dicom\r\n\r\n" << all[n];
    }
    file << "\r\n--b--\r\n";
    if (on_fetched) on_fetched();
    return "multipart/related; boundary=b";
  }
  std::optional<std::string> patient_of(const std::string&, const std::stop_token& stop) override {
    answer(stop);
    return is_merged ? "PAT-2" : "PAT-1";
  }
  bool has_instance(const InstancePlace& place, const std::stop_token& stop) override {
    answer(stop);
    const Lock lock(mutex_);
    return !is_unlisted && stored_.contains(place.instance);
  }
  PacsSeriesList search(const SeriesQuery& query, std::chrono::steady_clock::time_point,
                        const std::stop_token& stop) override {
    answer(stop);
    const Lock lock(mutex_);
    asked_ = query;
    return searchable_;
  }
  std::string segmented_series(const std::string&, const std::string&,
                               const std::stop_token& stop) override {
    answer(stop);
    return "1.7.7";
  }
  void store(const OutgoingObject& object, const std::stop_token& stop) override {
    answer(stop);
    ++stores;
    std::string bytes(object.bytes, ' ');
    object.read(0, std::as_writable_bytes(std::span(bytes)));
    const Lock lock(mutex_);
    stored_.insert(object.place.instance);
    last_object_ = bytes;
    after_store();
  }

  // The bytes of the object that was stored last.
  std::string last_object() {
    const Lock lock(mutex_);
    return last_object_;
  }

  // From now on the series has these files instead of its slices.
  void hold(const std::vector<std::string>& files) {
    const Lock lock(mutex_);
    held_ = files;
  }

  // A search finds this, whatever is asked.
  void find(const PacsSeriesList& found) {
    const Lock lock(mutex_);
    searchable_ = found;
  }
  SeriesQuery asked() {
    const Lock lock(mutex_);
    return asked_;
  }

 private:
  std::vector<std::string> files() {
    {
      const Lock lock(mutex_);
      if (!held_.empty()) return held_;
    }
    std::vector<std::string> slices;
    for (int slice = 0; slice < kSlices; ++slice) {
      slices.push_back(slice_file(slice, slice == foreign_slice ? "PAT-2" : "PAT-1"));
    }
    return slices;
  }

  void answer(const std::stop_token& stop) {
    ++calls;
    while (hangs) {
      if (stop.stop_requested()) {
        ++aborted;
        throw Error(ErrorCode::kCancelled, "stopped");
      }
      std::this_thread::sleep_for(milliseconds(2));
    }
    if (is_down) {
      throw PacsFailure(PacsFault::kUnreachable, "it is down", seconds(retry_after.load()));
    }
  }

  Mutex mutex_;
  std::set<std::string> stored_ ISOMESH_GUARDED_BY(mutex_);
  std::string last_object_ ISOMESH_GUARDED_BY(mutex_);
  std::vector<std::string> held_ ISOMESH_GUARDED_BY(mutex_);
  PacsSeriesList searchable_ ISOMESH_GUARDED_BY(mutex_);
  SeriesQuery asked_ ISOMESH_GUARDED_BY(mutex_);
};

// Tells until when nothing was due, and lets the test act before a change.
class WatchedOrders : public store::OrderStore {
 public:
  using OrderStore::OrderStore;

  std::vector<store::OrderRecord> due(store::Time now, std::size_t limit) const override {
    std::vector<store::OrderRecord> found = OrderStore::due(now, limit);
    if (found.empty()) {
      idle_at_ = std::max(idle_at_.load(), now);
    } else if (is_held_) {
      ++waiting_;
      is_held_.wait(true);
    }
    return found;
  }
  // From now on nobody learns of due orders until they are released.
  void hold() { is_held_ = true; }
  void release() {
    is_held_ = false;
    is_held_.notify_all();
  }
  int waiting() const { return waiting_; }
  store::Time idle_at() const { return idle_at_; }

  // A thread asks this before it sleeps because it has nothing to do.
  std::optional<store::Time> next_after(store::Time now) const override {
    looked_at_ = now;
    return OrderStore::next_after(now);
  }
  store::Time looked_at() const { return looked_at_; }

  // Set these before an order is there.
  std::function<void(const store::OrderRecord&)> before_save = [](const auto&) {};
  std::function<void()> before_cancel = [] {};

  bool save(const store::OrderRecord& record, store::Time next) override {
    try {
      before_save(record);
    } catch (const Error&) {
      ++unsaved_;
      throw;
    }
    return OrderStore::save(record, next);
  }
  int unsaved() const { return unsaved_; }
  store::CancelledOrder cancel(const store::Viewer& viewer, const std::string& id) override {
    before_cancel();
    return OrderStore::cancel(viewer, id);
  }

 private:
  std::atomic<int> unsaved_ = 0;
  mutable std::atomic<int> waiting_ = 0;
  std::atomic<bool> is_held_ = false;
  mutable std::atomic<store::Time> idle_at_ = store::Time();
  mutable std::atomic<store::Time> looked_at_ = store::Time();
};

// Counts how often somebody has begun to look at what is held.
class WatchedReceived : public store::ReceivedStore {
 public:
  using ReceivedStore::ReceivedStore;

  std::vector<store::HeldSeries> held() const override {
    const std::lock_guard lock(receiving_);
    ++looks_;
    return ReceivedStore::held();
  }
  // While it lives, nobody looks at what is held. A database's clock does not go with pass(), so
  // the orders would take a series as settled before all of it is there.
  [[nodiscard]] std::unique_lock<std::mutex> begin_receiving() {
    return std::unique_lock(receiving_);
  }
  int looks() const { return looks_; }

  std::vector<store::ReceivedInstance> instances(
      const store::ReceivedSeries& series) const override {
    if (series.route == "BROKEN") {
      ++failures_;
      throw Error(ErrorCode::kInternal, "it cannot be read");
    }
    return ReceivedStore::instances(series);
  }
  int failures() const { return failures_; }

 private:
  mutable std::mutex receiving_;
  mutable std::atomic<int> looks_ = 0;
  mutable std::atomic<int> failures_ = 0;
};

class OrdersTest : public test::JobsFixture {
 protected:
  OrdersTest() : JobsFixture({store::order_tables()}) {
    for (const char* name : {"main", "other"}) {
      PacsSettings settings;
      settings.name = name;
      settings.dicomweb = "http://pacs.example.org";
      settings_.pacs.push_back(settings);
      const auto pacs = std::make_shared<FakePacs>();
      (name == std::string("main") ? main_ : other_) = pacs.get();
      peers_[name] = {.source = pacs, .archive = pacs, .receiver = pacs};
    }
    settings_.settle = seconds(0);
    settings_.first_delay = seconds(20);
    begin();
  }

  // As a process that goes on after the last one.
  void begin() {
    orders_.reset();
    orders_ = std::make_unique<Orders>(OrderServices{.folder = data_,
                                                     .blobs = blobs_,
                                                     .volumes = volumes_,
                                                     .jobs = jobs_,
                                                     .library = library_,
                                                     .labels = labels_,
                                                     .orders = store_,
                                                     .audit = audit_,
                                                     .received = received_,
                                                     .peers = peers_},
                                       settings_,
                                       OrderOptions{.now = [this] { return now(); },
                                                    .keep_orders = [this] { return keep(); },
                                                    .cut_off = [this] { store_.release(); },
                                                    .threads = 3,
                                                    .searches_per_pacs = 1,
                                                    .searches = 2});
    orders_->on_end([](const std::string&) {});
  }

  void stop() { orders_.reset(); }

  std::string submit(const std::string& pacs = "main", const std::string& series = kSeries,
                     const std::string& parameters = R"({"iso": 100})") {
    OrderRequest request;
    request.source = {.pacs = pacs, .study = kStudy, .series = series};
    request.parameters = parameters;
    request.send = {{.pacs = pacs}};
    return submit(request);
  }
  std::string submit(const OrderRequest& request) {
    return orders_->submit({.name = "", .is_administrator = true}, request, "", "").first.id;
  }

  Order get(const std::string& id) const { return orders_->get(std::nullopt, id); }

  store::Time now() const { return std::chrono::system_clock::now() + ahead_.load(); }

  // As when another process takes the orders, and as when it ends.
  void lose_orders() { are_lost_ = true; }
  void regain_orders() { are_lost_ = false; }
  std::string keep() const { return are_lost_ ? "another process has them" : ""; }

  void pass(milliseconds time) {
    ahead_ = ahead_.load() + time;
    orders_->wake();
  }

  // Waits for what threads of the orders bring about, not for the clock.
  static bool until(const std::function<bool()>& is_so) { return test::eventually(is_so); }
  bool reaches(const std::string& id, OrderState state) {
    return until([&] { return get(id).state == state; });
  }

  // Expects the order to fail that often, each time after a pause that doubles.
  void fails_with_growing_pauses(const std::string& id, std::uint32_t times) {
    store::Time due = time_of(get(id).created);  // no attempt is earlier than the one that was due
    for (std::uint32_t attempts = 1; attempts <= times; ++attempts) {
      ASSERT_TRUE(until([&] { return get(id).attempts >= attempts; })) << attempts;
      const Order order = get(id);
      ASSERT_EQ(order.attempts, attempts);
      ASSERT_TRUE(order.next_attempt && order.error);
      const store::Time next = time_of(*order.next_attempt);
      // A pause is at least half of its full length.
      EXPECT_GE(next - due, settings_.first_delay * (1 << (attempts - 1)) / 2);
      due = next;
      pass(std::chrono::ceil<milliseconds>(due - now()));
    }
  }

  std::vector<std::string> outcomes_of(const std::string& event, const std::string& order) const {
    std::vector<std::string> outcomes;
    audit_.read(0, [&](std::string_view line) {
      const auto entry = nlohmann::json::parse(line);
      if (entry.at("event") == event && entry.value("order", "") == order) {
        outcomes.push_back(entry.at("outcome"));
      }
    });
    return outcomes;
  }

  // Does what a worker does with the next job: a mesh of so many triangles. The orders are told of
  // its end after `before_told`.
  bool finish_job(
      std::uint32_t triangles = 1,
      const std::function<void(const std::string& job)>& before_told = [](const auto&) {}) {
    std::optional<store::Lease> lease;
    if (!until([&] { return (lease = jobs_.claim("test", minutes(1))).has_value(); })) return false;
    last_parameters_ = lease->parameters;
    std::string stl(84 + std::size_t{50} * triangles, '\0');
    stl[80] = 1;
    const store::Blob blob = test::put(blobs_, stl);
    store::Outcome outcome;
    outcome.mesh.emplace().triangles = triangles;
    outcome.mesh->empty = triangles == 0;
    if (outcome.mesh->empty) outcome.mesh->empty_reason = "the iso-value separates no samples";
    outcome.mesh->labels_count = labels_of_mesh_;
    outcome.mesh->files[MeshFormat::kStl] = {.bytes = blob.bytes, .sha256 = blob.key, .href = "/x"};
    if (bytes_of_obj_ > 0) {
      const store::Blob obj = test::put(blobs_, std::string(bytes_of_obj_, '#'));
      outcome.mesh->files[MeshFormat::kObj] = {.bytes = obj.bytes, .sha256 = obj.key, .href = "/y"};
    }
    const bool is_done = jobs_.finish(*lease, outcome);
    before_told(lease->id);
    orders_->job_ended(lease->id);
    return is_done;
  }

  std::atomic<milliseconds> ahead_ = milliseconds(0);
  std::atomic<bool> are_lost_ = false;
  HospitalSettings settings_;
  Peers peers_;
  FakePacs* main_ = nullptr;
  FakePacs* other_ = nullptr;
  jobs::LabelLists labels_{blobs_};
  WatchedOrders store_{database_};
  store::AuditTrail audit_{database_};
  WatchedReceived received_{database_};
  std::optional<std::uint64_t> labels_of_mesh_;
  std::size_t bytes_of_obj_ = 0;   // 0: the mesh has no OBJ
  JobParameters last_parameters_;  // of the job that was finished last
  std::unique_ptr<Orders> orders_;
};

}  // namespace isomesh::orders
