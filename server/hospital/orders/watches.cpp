// Watches of rules, and the removal of old orders.
#include <algorithm>
#include <utility>

#include "base/clock.h"
#include "base/ids.h"
#include "base/log.h"
#include "server/hospital/objects/uid.h"
#include "server/hospital/orders/orders.h"
#include "server/hospital/orders/pattern.h"

namespace isomesh::orders {
namespace {

constexpr std::chrono::minutes kForgetPause{10};

// The day that many days ago (DA), minus one, because studies have dates without time zones.
std::string day_before(store::Time now, std::uint32_t days) {
  return utc_text(now - std::chrono::days(days) - std::chrono::days(1), "%Y%m%d");
}

// The time that watches look back, and at least a quarter of a year: a series that is forgotten
// before would be ordered again.
std::chrono::days longest_look(const std::vector<Rule>& rules) {
  constexpr std::chrono::days kMargin{2};  // of dates without time zones
  std::chrono::days longest{90};
  for (const Rule& rule : rules) {
    if (rule.watch) longest = std::max(longest, std::chrono::days(rule.match.days) + kMargin);
  }
  return longest;
}

bool is_wanted(const FoundSeries& series, const SeriesMatch& match) {
  if (is_own_modality(series.modality)) return false;
  if (!match.modality.empty() && series.modality != match.modality) return false;
  if (!match.series_description.empty() && !matches(match.series_description, series.description)) {
    return false;
  }
  return series.instances.value_or(match.min_instances) >= match.min_instances;
}

// The procedure of a workitem that the rule performs; null if it does not.
const std::string* wanted_procedure(const FoundWorkitem& item, const Rule& rule) {
  if (item.state != "SCHEDULED" || (!item.readiness.empty() && item.readiness != "READY") ||
      item.study.empty() || item.series.empty()) {
    return nullptr;
  }
  const auto is_wanted_code = [&](const std::string& code) {
    return std::ranges::any_of(
        rule.procedures, [&](const std::string& wanted) { return code.starts_with(wanted + '^'); });
  };
  const auto found = std::ranges::find_if(item.procedures, is_wanted_code);
  return found == item.procedures.end() ? nullptr : &*found;
}

}  // namespace

void Orders::look_at_rule(const Rule& rule, const std::stop_token& stop) {
  const auto peer = services_.peers.find(*rule.watch);
  if (peer == services_.peers.end() || !peer->second.archive) return;
  try {
    bool is_told = false;
    const RecentSeries found = peer->second.archive->find_recent(
        day_before(options_.now(), rule.match.days), rule.match.modality, stop);
    for (const FoundSeries& series : found.series) {
      if (!is_wanted(series, rule.match)) continue;
      const store::OrderRecord record = make_order(rule, *rule.watch, series);
      const bool is_new = services_.orders.submit_watched(
          {.record = record, .idempotency_key = "", .request_digest = ""},
          {.rule = rule.name,
           .study = series.study,
           .series = series.series,
           .instances = series.instances},
          settings_.most_open);
      if (!is_new) continue;
      // A watch repeats its query all day; only queries that led to orders are recorded.
      if (!std::exchange(is_told, true)) {
        services_.audit.add(
            {.event = store::AuditEvent::kQuery, .owner = rule.owner, .peer_name = *rule.watch});
      }
      log(record, "");
      changed();
    }
    if (found.is_cut) {
      throw PacsFailure(PacsFault::kIncomplete, "the PACS does not list all recent series");
    }
    note_success(*rule.watch);
  } catch (...) {
    note_watch_failure(rule, *rule.watch);
  }
}

// Call while an exception is handled.
void Orders::note_watch_failure(const Rule& rule, const std::string& pacs) {
  try {
    throw;
  } catch (const PacsFailure& failure) {
    note_failure(pacs, failure, "");
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCancelled)
      log_error("the watch of rule {} failed and is retried: {}", rule.name, error.what());
  } catch (const std::exception& error) {
    log_error("the watch of rule {} failed and is retried: {}", rule.name, error.what());
  }
}

void Orders::look_at_worklist(const Rule& rule, const std::stop_token& stop) {
  const auto peer = services_.peers.find(*rule.worklist);
  if (peer == services_.peers.end() || !peer->second.worklist) return;
  try {
    for (const FoundWorkitem& item : peer->second.worklist->find_scheduled(stop)) {
      const std::string* procedure = wanted_procedure(item, rule);
      if (procedure == nullptr) continue;
      store::OrderRecord record = make_order(rule, rule.images,
                                             {.study = item.study,
                                              .series = item.series,
                                              .modality = "",
                                              .description = "",
                                              .instances = std::nullopt});
      record.work.workitem = Workitem{.worklist = *rule.worklist,
                                      .uid = item.uid,
                                      .procedure = *procedure,
                                      .transaction = dicom::name_based_uid(random_hex(32)),
                                      .patient_id = item.patient_id};
      // The key is the same for all attempts, also of other processes.
      const store::OrderSubmission submission =
          services_.orders.submit({.record = record,
                                   .idempotency_key = "workitem " + *rule.worklist + ' ' + item.uid,
                                   .request_digest = "workitem"},
                                  settings_.most_open);
      if (submission.kind != store::OrderSubmission::Kind::kNew) continue;
      log(record, "");
      changed();
    }
    note_success(*rule.worklist);
  } catch (...) {
    note_watch_failure(rule, *rule.worklist);
  }
}

// Each watched PACS has a thread, because it may take any time. So it gets the queries of its rules
// one after another.
void Orders::watch(const std::string& pacs, const std::stop_token& stop) {
  const auto is_over = [&] { return stop.stop_requested() || is_paused(); };
  while (!stop.stop_requested()) {
    for (const Rule& rule : settings_.rules) {
      if (rule.watch == pacs && !is_over()) look_at_rule(rule, stop);
      if (rule.worklist == pacs && !is_over()) look_at_worklist(rule, stop);
    }
    isomesh::pause(stop, settings_.poll);
  }
}

void Orders::forget_ended(const std::stop_token& stop) {
  store::Time next = options_.now();
  while (!stop.stop_requested()) {
    try {
      const store::Time now = options_.now();
      if (now >= next) {
        next = now + kForgetPause;
        forget();
      }
    } catch (const std::exception& error) {
      log_error("ended orders could not be removed and are retried: {}", error.what());
    }
    isomesh::pause(stop, settings_.poll);
  }
}

void Orders::forget() {
  const store::Time before =
      (options_.believed_now ? options_.believed_now() : options_.now()) - options_.keep;
  const std::size_t orders =
      services_.orders.forget(before, before - longest_look(settings_.rules));
  const std::size_t instances = services_.received.forget(before);
  const std::size_t workitems = options_.forget_also ? options_.forget_also(before) : 0;
  if (orders + instances + workitems == 0) return;
  log_info(
      "removed {} orders that ended before {} (--keep-days), the notes of {} instances, and {} "
      "workitems",
      orders, timestamp_of(before), instances, workitems);
}

}  // namespace isomesh::orders
