#include "server/hospital/worklist/query.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <string_view>

#include "base/error.h"
#include "base/text.h"
#include "server/hospital/orders/pattern.h"
#include "server/hospital/worklist/workitem.h"

namespace isomesh::worklist {
namespace {

using nlohmann::json;

constexpr const char* kStateTag = "00741000";
constexpr const char* kTransactionTag = "00081195";

// The keywords of the attributes of workitems and of their codes.
constexpr std::array kKeywords = {
    std::pair("AccessionNumber", "00080050"),
    std::pair("AdmissionID", "00380010"),
    std::pair("CodeMeaning", "00080104"),
    std::pair("CodeValue", "00080100"),
    std::pair("CodingSchemeDesignator", "00080102"),
    std::pair("ExpectedCompletionDateTime", "00404011"),
    std::pair("HumanPerformerCodeSequence", "00404009"),
    std::pair("InputInformationSequence", "00404021"),
    std::pair("InputReadinessState", "00404041"),
    std::pair("IssuerOfPatientID", "00100021"),
    std::pair("PatientBirthDate", "00100030"),
    std::pair("PatientID", "00100020"),
    std::pair("PatientName", "00100010"),
    std::pair("PatientSex", "00100040"),
    std::pair("PerformedStationNameCodeSequence", "00404028"),
    std::pair("PerformedWorkitemCodeSequence", "00404019"),
    std::pair("ProcedureStepLabel", "00741204"),
    std::pair("ProcedureStepState", kStateTag),
    std::pair("ReferencedRequestSequence", "0040A370"),
    std::pair("RequestedProcedureID", "00401001"),
    std::pair("SOPClassUID", "00080016"),
    std::pair("SOPInstanceUID", "00080018"),
    std::pair("ScheduledHumanPerformersSequence", "00404034"),
    std::pair("ScheduledProcedureStepModificationDateTime", "00404010"),
    std::pair("ScheduledProcedureStepPriority", "00741200"),
    std::pair("ScheduledProcedureStepStartDateTime", "00404005"),
    std::pair("ScheduledStationClassCodeSequence", "00404026"),
    std::pair("ScheduledStationGeographicLocationCodeSequence", "00404027"),
    std::pair("ScheduledStationNameCodeSequence", "00404025"),
    std::pair("ScheduledWorkitemCodeSequence", "00404018"),
    std::pair("SeriesInstanceUID", "0020000E"),
    std::pair("StudyInstanceUID", "0020000D"),
    std::pair("UnifiedProcedureStepPerformedProcedureSequence", "00741216"),
    std::pair("WorklistLabel", "00741202")};

std::string tag_of(const std::string& parameter, std::string_view part) {
  const auto* const known =
      std::ranges::find(kKeywords, part, [](const auto& each) { return each.first; });
  if (known != kKeywords.end()) return known->second;
  std::string tag(part);
  std::ranges::transform(tag, tag.begin(), [](char c) {
    return c >= 'a' && c <= 'f' ? static_cast<char>(c - 32) : c;
  });
  const bool is_tag = tag.size() == 8 && tag.find_first_not_of("0123456789ABCDEF") == tag.npos;
  if (!is_tag) {
    throw invalid_parameter(parameter,
                            "is no known keyword of an attribute; give its tag, as in 00741000");
  }
  // Searches could guess it digit by digit.
  if (tag == kTransactionTag) throw invalid_parameter(parameter, "cannot be searched for");
  return tag;
}

std::size_t number_of(const std::string& name, const std::string& value) {
  const auto number = parse_uint64(value);
  if (!number) throw invalid_parameter(name, "must be a whole number");
  return *number;
}

// The time zone at the end of a DT. Years are not confused with it: a zone is at most +1400.
std::string_view without_zone(std::string_view moment) {
  if (moment.size() <= 5) return moment;
  const std::string_view zone = moment.substr(moment.size() - 5);
  const bool is_zone = (zone.front() == '+' || zone.front() == '-') &&
                       zone.find_first_not_of("0123456789", 1) == zone.npos &&
                       zone.substr(1) <= "1400";
  return is_zone ? moment.substr(0, moment.size() - 5) : moment;
}

int number_at(std::string_view digits, std::size_t from, std::size_t count) {
  int number = 0;
  std::from_chars(digits.data() + from, digits.data() + from + count, number);
  return number;
}

// As a DT has them. Not by the system's clock, whose nanoseconds end in 2262: some write 9999 for
// no end.
std::string digits_of(std::chrono::sys_time<std::chrono::minutes> time) {
  using std::chrono::sys_days;
  using std::chrono::year;
  // A zone may lead beyond the years that have four digits.
  time = std::clamp(time, decltype(time)(sys_days(year(0) / 1 / 1)),
                    decltype(time)(sys_days(year(10'000) / 1 / 1)) - std::chrono::minutes(1));
  const auto midnight = std::chrono::floor<std::chrono::days>(time);
  const std::chrono::year_month_day day(midnight);
  const std::chrono::hh_mm_ss clock(time - midnight);
  std::array<char, 32> text = {};
  std::snprintf(text.data(), text.size(), "%04d%02u%02u%02d%02d", static_cast<int>(day.year()),
                static_cast<unsigned>(day.month()), static_cast<unsigned>(day.day()),
                static_cast<int>(clock.hours().count()), static_cast<int>(clock.minutes().count()));
  return text.data();
}

// A moment with a zone in UTC, as precisely as it is given; a day stays as it is, without its zone.
std::string in_utc(std::string_view moment) {
  constexpr std::size_t kToHour = 10;
  constexpr std::size_t kToMinute = 12;
  const std::string_view bare = without_zone(moment);
  if (bare.size() < kToHour || bare.find_first_not_of("0123456789.") != bare.npos) {
    return std::string(bare);
  }
  const std::string_view zone = moment.substr(bare.size());
  const std::chrono::minutes east =
      std::chrono::hours(number_at(zone, 1, 2)) + std::chrono::minutes(number_at(zone, 3, 2));
  const std::size_t known = bare.size() < kToMinute ? kToHour : kToMinute;
  const std::chrono::year_month_day day(
      std::chrono::year(number_at(bare, 0, 4)),
      std::chrono::month(static_cast<unsigned>(number_at(bare, 4, 2))),
      std::chrono::day(static_cast<unsigned>(number_at(bare, 6, 2))));
  if (!day.ok()) return std::string(bare);
  const std::chrono::sys_time<std::chrono::minutes> time =
      std::chrono::sys_days(day) + std::chrono::hours(number_at(bare, 8, 2)) +
      std::chrono::minutes(known == kToMinute ? number_at(bare, kToHour, 2) : 0) -
      (zone.front() == '-' ? -east : east);
  return digits_of(time).substr(0, known) + std::string(bare.substr(known));
}

bool has_zone(std::string_view moment) { return without_zone(moment).size() < moment.size(); }

// Compares as far as both are given: 2026 is before 20270101, and the same as 20261231. Nobody
// knows the zone of a moment without one, so it is compared as it is written.
int compared(std::string_view left_moment, std::string_view right_moment) {
  const bool have_zones = has_zone(left_moment) && has_zone(right_moment);
  const auto text = [&](std::string_view moment) {
    return have_zones ? in_utc(moment) : std::string(without_zone(moment));
  };
  const std::string left = text(left_moment);
  const std::string right = text(right_moment);
  const std::size_t length = std::min(left.size(), right.size());
  return left.compare(0, length, right, 0, length);
}

// The hyphen of a range; npos for one moment. Only a DT has zones, and so hyphens of its own: each
// has its digits behind it, and then that of the range or the end.
std::size_t hyphen_of_range(std::string_view wanted, bool has_zones) {
  const auto is_of_zone = [&](std::size_t hyphen) {
    const std::size_t end = hyphen + 5;
    return has_zones && end <= wanted.size() && (end == wanted.size() || wanted[end] == '-') &&
           without_zone(wanted.substr(0, end)).size() == hyphen;
  };
  std::size_t hyphen = wanted.find('-');
  while (hyphen != wanted.npos && is_of_zone(hyphen)) hyphen = wanted.find('-', hyphen + 1);
  return hyphen;
}

// PS3.4, C.2.2.2.5: one moment, or a range with a hyphen.
bool is_in_range(std::string_view wanted, std::string_view moment, bool has_zones) {
  const std::size_t hyphen = hyphen_of_range(wanted, has_zones);
  if (hyphen == wanted.npos) return compared(wanted, moment) == 0;
  const std::string_view from = wanted.substr(0, hyphen);
  const std::string_view to = wanted.substr(hyphen + 1);
  return (from.empty() || compared(from, moment) <= 0) && (to.empty() || compared(moment, to) <= 0);
}

bool is_one_of(std::string_view wanted, std::string_view uid) {
  while (true) {
    const std::size_t end = wanted.find_first_of(",\\");
    if (wanted.substr(0, end) == uid) return true;
    if (end == wanted.npos) return false;
    wanted.remove_prefix(end + 1);
  }
}

// Only names match whatever the case of letters (PS3.4, C.2.2.2.1): "a1" and "A1" are two patients.
bool value_matches(const std::string& vr, const json& value, const std::string& wanted) {
  if (value.is_object()) {  // of a name: its groups
    return std::ranges::any_of(value, [&](const json& group) {
      return group.is_string() && orders::matches(wanted, group.get_ref<const std::string&>());
    });
  }
  if (value.is_null()) return false;
  const std::string text = value.is_string() ? value.get<std::string>() : value.dump();
  if (vr == "UI") return is_one_of(wanted, text);
  if (vr == "DT") {
    // A plus sign that a client did not encode is a blank in the query of a URL.
    std::string moments = wanted;
    std::ranges::replace(moments, ' ', '+');
    return is_in_range(moments, text, true);
  }
  if (vr == "DA" || vr == "TM") return is_in_range(wanted, text, false);
  return orders::matches_case(wanted, text);
}

bool attribute_matches(const DataSet& data, const std::vector<std::string>& path, std::size_t at,
                       const std::string& wanted) {
  const auto& values = values_of(data, path[at]);
  if (at + 1 < path.size()) {
    return std::ranges::any_of(values, [&](const json& item) {
      return item.is_object() && attribute_matches(item, path, at + 1, wanted);
    });
  }
  if (values.empty()) return false;
  const auto vr = data.at(path[at]).at("vr").get<std::string>();
  if (vr == "SQ") return false;
  return std::ranges::any_of(values,
                             [&](const json& value) { return value_matches(vr, value, wanted); });
}

}  // namespace

std::optional<store::WorkitemState> Query::state() const {
  using store::WorkitemState;
  for (const auto& [path, value] : keys) {
    if (path.size() != 1 || path.front() != kStateTag) continue;
    for (const WorkitemState state : {WorkitemState::kScheduled, WorkitemState::kInProgress,
                                      WorkitemState::kCompleted, WorkitemState::kCanceled}) {
      if (value == to_string(state)) return state;
    }
  }
  return std::nullopt;
}

Query parse_query(const std::vector<std::pair<std::string, std::string>>& parameters) {
  constexpr std::size_t kMostKeys = 50;
  Query query;
  for (const auto& [name, value] : parameters) {
    if (name == "limit") {
      query.limit = std::min(number_of(name, value), kMostResults);
    } else if (name == "offset") {
      query.offset = number_of(name, value);
    } else if (name == "includefield") {
      continue;  // results have all attributes
    } else if (name == "fuzzymatching") {
      query.wants_fuzzy = lower(value) == "true";
      if (!query.wants_fuzzy && lower(value) != "false") {
        throw invalid_parameter(name, "must be true or false");
      }
    } else {
      std::vector<std::string> path;
      for (const std::string_view part : split(name, '.')) path.push_back(tag_of(name, part));
      // An empty value matches everything, and so does * (PS3.4, C.2.2.2.4).
      if (value.find_first_not_of('*') != value.npos)
        query.keys.emplace_back(std::move(path), value);
      if (query.keys.size() > kMostKeys) throw invalid_parameter(name, "is one too many");
    }
  }
  return query;
}

bool matches(const Query& query, const DataSet& data) {
  return std::ranges::all_of(query.keys, [&](const auto& key) {
    return attribute_matches(data, key.first, 0, key.second);
  });
}

}  // namespace isomesh::worklist
