#include "server/hospital/hospital.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include <unistd.h>

#include "base/ids.h"
#include "base/log.h"
#include "server/hospital/audit/syslog.h"
#include "server/hospital/c_store/listener.h"
#include "server/hospital/c_store/sender.h"
#include "server/hospital/dicomweb/dicomweb.h"
#include "server/hospital/dicomweb/ups.h"
#include "server/hospital/orders/orders.h"
#include "server/hospital/orders/received.h"
#include "server/hospital/orders/settings.h"
#include "server/hospital/records/order_store.h"
#include "server/hospital/records/received_store.h"
#include "server/hospital/records/tables.h"
#include "server/hospital/records/workitem_store.h"
#include "server/hospital/routes.h"
#include "server/hospital/worklist_routes.h"
#include "server/jobs/library/import_runner.h"
#include "server/process/prepared.h"

namespace isomesh::hospital {
namespace {

jobs::RunnerOptions response_runner(const http::WingSettings& settings) {
  jobs::RunnerOptions runner;
  runner.program = settings.program("isomesh-import");
  runner.bounds = {.memory_bytes = std::uint64_t{1} << 30, .time = std::chrono::minutes(1)};
  return runner;
}

bool needs_dimse(const orders::HospitalSettings& hospital) {
  return hospital.dimse || std::ranges::any_of(hospital.pacs, [](const orders::PacsSettings& pacs) {
           return pacs.send_by == orders::SendBy::kCStore;
         });
}

// Null if DIMSE is not configured.
std::unique_ptr<process::PreparedProcesses> prepare_dimse(const orders::HospitalSettings& hospital,
                                                          const http::WingSettings& settings) {
  // Expected number of simultaneous starts; further processes start with a short delay.
  constexpr std::size_t kPrepared = 2;
  if (!needs_dimse(hospital)) return nullptr;
  return std::make_unique<process::PreparedProcesses>(settings.program("isomesh-dimse"), kPrepared);
}

// Null if no collector is configured.
std::unique_ptr<audit::SyslogSender> send_trail(const orders::HospitalSettings& hospital,
                                                store::AuditTrail& trail) {
  if (!hospital.syslog) return nullptr;
  const orders::SyslogSettings& to = *hospital.syslog;
  return std::make_unique<audit::SyslogSender>(
      trail,
      audit::TlsServer{.host = to.host,
                       .port = to.port,
                       .authorities = to.ca_file,
                       .certificate = to.certificate_file,
                       .key = to.key_file},
      audit::AuditSource{
          .station = hospital.station_name, .host = host_name(), .process = ::getpid()});
}

class OpenHospital {
 public:
  OpenHospital(const http::WingSettings& settings, const http::WingServices& services)
      : settings_(orders::read_settings(settings.file)),
        order_store_(services.records, services.has_task),
        received_(services.records),
        workitems_(services.records),
        responses_(response_runner(settings)),
        dimse_(prepare_dimse(settings_, settings)),
        peers_(peers(settings, services)),
        audit_(send_trail(settings_, services.audit)),
        orders_({.folder = services.folder,
                 .blobs = services.blobs,
                 .volumes = services.volumes,
                 .jobs = services.jobs,
                 .library = services.library,
                 .labels = services.labels,
                 .orders = order_store_,
                 .audit = services.audit,
                 .received = received_,
                 .peers = peers_},
                settings_,
                {.keep = settings.keep,
                 .believed_now = services.believed_now,
                 .keep_orders = services.keep_task,
                 .cut_off =
                     [this, &services] {
                       responses_.stop();
                       if (dimse_) dimse_->stop();
                       services.library.stop_imports();
                     },
                 .forget_also = [this](store::Time before) { return workitems_.forget(before); }}) {
    if (settings_.worklist) {
      worklist_.emplace(OwnWorklist{.settings = *settings_.worklist,
                                    .workitems = workitems_,
                                    .cancel_performing = [this](const std::string& transaction) {
                                      return orders_.cancel_performing(transaction);
                                    }});
    }
    if (!settings_.dimse) return;
    listener_ = std::make_unique<c_store::DimseListener>(
        c_store::ListenerServices{.folder = services.folder,
                                  .blobs = services.blobs,
                                  .volumes = services.volumes,
                                  .received = received_,
                                  .audit = services.audit,
                                  .processes = *dimse_},
        *settings_.dimse);
    log_info("receiving series by C-STORE on {}{}", listener_->authority(),
             settings_.dimse->certificate_file.empty() ? "" : " over TLS");
  }

  orders::Orders& orders() { return orders_; }
  const std::vector<orders::Rule>& rules() const { return settings_.rules; }
  // Null if it is not configured.
  const OwnWorklist* worklist() const { return worklist_ ? &*worklist_ : nullptr; }

  void begin_drain() {
    if (listener_) listener_->stop();
  }

  void stop() {
    orders_.stop();
    if (audit_) audit_->stop();
  }

 private:
  orders::Peer peer(const orders::PacsSettings& pacs, const http::WingSettings& settings,
                    const std::filesystem::path& scratch) {
    orders::Peer peer;
    if (!pacs.dicomweb.empty()) {
      const auto web = std::make_shared<dicomweb::DicomWeb>(pacs, scratch,
                                                            settings.max_upload_bytes, responses_);
      peer = {.source = web,
              .archive = web,
              .receiver = web,
              .worklist = std::make_shared<dicomweb::Ups>(pacs, scratch, responses_)};
    }
    if (pacs.send_by == orders::SendBy::kCStore) {
      peer.receiver = std::make_shared<c_store::Sender>(pacs, *dimse_);
    }
    return peer;
  }

  orders::Peers peers(const http::WingSettings& settings, const http::WingServices& services) {
    orders::Peers all;
    for (const orders::PacsSettings& pacs : settings_.pacs) {
      all[pacs.name] = peer(pacs, settings, services.folder.scratch());
    }
    if (!settings_.dimse) return all;
    for (const auto& [title, rule] : settings_.dimse->routes) {
      all[orders::received_by(title)].source =
          std::make_shared<orders::Received>(title, received_, services.blobs);
    }
    return all;
  }

  const orders::HospitalSettings settings_;
  store::OrderStore order_store_;
  store::ReceivedStore received_;
  store::WorkitemStore workitems_;
  jobs::ImportRunner responses_;
  std::unique_ptr<process::PreparedProcesses> dimse_;
  const orders::Peers peers_;
  std::unique_ptr<audit::SyslogSender> audit_;
  orders::Orders orders_;
  std::optional<OwnWorklist> worklist_;
  std::unique_ptr<c_store::DimseListener> listener_;  // null if no series are received
};

// Begins with 0 for every state and rule, and for orders without a rule: a change needs a first
// sample.
http::MeasuredFamily orders_of(const store::OrderCounts& counts,
                               const std::vector<orders::Rule>& rules) {
  auto by_state_and_rule = counts.by_state_and_rule;
  for (int each = 0; each <= static_cast<int>(OrderState::kCancelled); ++each) {
    const auto state = static_cast<OrderState>(each);
    by_state_and_rule.try_emplace({state, ""}, 0);
    for (const orders::Rule& rule : rules) by_state_and_rule.try_emplace({state, rule.name}, 0);
  }
  http::MeasuredFamily family{.name = "isomesh_orders", .help = "Orders by state and rule"};
  for (const auto& [what, count] : by_state_and_rule) {
    family.values.push_back({{{"state", std::string(to_string(what.first))}, {"rule", what.second}},
                             static_cast<double>(count)});
  }
  return family;
}

http::MeasuredFamily failures_of(const std::vector<orders::Attempts>& failed) {
  http::MeasuredFamily family{
      .name = "isomesh_order_attempts_failed_total",
      .help = "Failed attempts of orders, watches and searches, by PACS and reason",
      .is_counter = true};
  for (const orders::Attempts& attempts : failed) {
    family.values.push_back(
        {{{"pacs", attempts.pacs}, {"reason", std::string(orders::to_string(attempts.fault))}},
         static_cast<double>(attempts.count)});
  }
  return family;
}

http::MeasuredFamily oldest_of(const store::OrderCounts& counts) {
  const auto age = counts.oldest_open ? std::chrono::system_clock::now() - *counts.oldest_open
                                      : std::chrono::system_clock::duration::zero();
  return {.name = "isomesh_oldest_open_order_seconds",
          .help = "Age of the oldest open order; 0 without one",
          .values = {{{}, std::chrono::duration<double>(age).count()}}};
}

http::MeasuredFamily paused(bool is_paused) {
  return {.name = "isomesh_orders_paused",
          .help = "1 while another daemon processes the orders, or the database does not respond",
          .values = {{{}, is_paused ? 1.0 : 0.0}}};
}

class HospitalWing final : public http::Wing {
 public:
  HospitalWing(const http::WingSettings& settings, const http::WingServices& services)
      : services_(services) {
    if (!settings.file.empty()) hospital_ = std::make_unique<OpenHospital>(settings, services_);
  }

  bool is_open() const override { return hospital_ != nullptr; }

  void add_routes(http::App& app) override {
    add_order_routes(app, hospital_ ? &hospital_->orders() : nullptr);
    add_worklist_routes(app, hospital_ ? hospital_->worklist() : nullptr);
  }

  std::optional<bool> has_ended(const std::string& id) const override {
    if (!hospital_) return std::nullopt;
    try {
      return is_final(hospital_->orders().get(std::nullopt, id).state);
    } catch (const Error&) {
      return std::nullopt;  // not an order
    }
  }

  void on_end(std::function<void(const std::string& order)> listener) override {
    if (hospital_) hospital_->orders().on_end(std::move(listener));
  }

  void job_ended(const std::string& job) override {
    if (hospital_) hospital_->orders().job_ended(job);
  }

  std::vector<http::MeasuredFamily> measure() const override {
    if (!hospital_) return {};
    const store::OrderCounts counts = hospital_->orders().counts();
    return {orders_of(counts, hospital_->rules()), failures_of(hospital_->orders().attempts()),
            oldest_of(counts), paused(hospital_->orders().is_paused())};
  }

  void begin_drain() override {
    if (hospital_) hospital_->begin_drain();
  }

  void stop() override {
    if (hospital_) hospital_->stop();
  }

 private:
  const http::WingServices services_;
  std::unique_ptr<OpenHospital> hospital_;  // null if not configured
};

}  // namespace

std::vector<store::Schema> tables() { return {store::order_tables()}; }

http::ConfiguredFiles check(const std::filesystem::path& file) {
  const orders::HospitalSettings hospital = orders::read_settings(file);
  if (hospital.dimse) c_store::listen_address(*hospital.dimse);
  http::ConfiguredFiles files;
  for (const orders::PacsSettings& pacs : hospital.pacs) {
    const std::string name = "pacs " + pacs.name + ": ";
    files.emplace_back(name + "ca-file", pacs.ca_file);
    files.emplace_back(name + "password-file", pacs.password_file);
    files.emplace_back(name + "token-file", pacs.token_file);
    files.emplace_back(name + "certificate-file", pacs.certificate_file);
    files.emplace_back(name + "key-file", pacs.key_file);
  }
  if (const auto& dimse = hospital.dimse) {
    files.emplace_back("dimse.certificate-file", dimse->certificate_file);
    files.emplace_back("dimse.key-file", dimse->key_file);
    files.emplace_back("dimse.ca-file", dimse->ca_file);
  }
  if (const auto& syslog = hospital.syslog) {
    files.emplace_back("audit.ca-file", syslog->ca_file);
    files.emplace_back("audit.certificate-file", syslog->certificate_file);
    files.emplace_back("audit.key-file", syslog->key_file);
  }
  return files;
}

std::unique_ptr<http::Wing> open(const http::WingSettings& settings,
                                 const http::WingServices& services) {
  return std::make_unique<HospitalWing>(settings, services);
}

}  // namespace isomesh::hospital
