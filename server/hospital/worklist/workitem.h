// The rules of workitems: their attributes, their states, and who may change them (PS3.4, CC.1.1
// and CC.2). Pure functions.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "server/hospital/records/workitem_store.h"
#include "server/hospital/worklist/dicom_json.h"
#include "server/store/expiry.h"

namespace isomesh::worklist {

// The largest data set of a request, and of a workitem.
inline constexpr std::size_t kMostBodyBytes = std::size_t{1} << 20;

// A request that a rule forbids. The warning is the sentence that PS3.18 wants in the header of
// that name; empty if it has none for this.
class Refusal : public Error {
 public:
  Refusal(ErrorCode code, const std::string& detail, std::string warning)
      : Error(code, detail), warning_(std::move(warning)) {}

  const std::string& warning() const { return warning_; }

 private:
  std::string warning_;
};

std::string_view to_string(store::WorkitemState state);

// The words of the standard about a workitem that already is in the requested state.
std::string already_in(store::WorkitemState state);

// The attributes in a record; empty if it is damaged, which is reported.
std::optional<DataSet> readable_data(const store::WorkitemRecord& record);
// The same. Throws Error kInternal if it is damaged.
DataSet data_of(const store::WorkitemRecord& record);

// A new workitem. `uid` is that of the query; empty if there is none. Throws Error
// kInvalidParameter.
store::WorkitemRecord new_workitem(const std::string& uid, DataSet data, store::Time now);

// Each of these throws Error kInvalidParameter, kNotReady (a conflict) or kTooLarge.

// `transaction` is that of the query; empty if the data set has it, or nobody has it.
void update(store::WorkitemRecord& record, DataSet changes, const std::string& transaction,
            store::Time now);

// Both return the warning of a success, or "".
std::string change_state(store::WorkitemRecord& record, const DataSet& request, store::Time now);
// A request of somebody who does not perform the workitem. `request` may be empty.
std::string cancel(store::WorkitemRecord& record, const DataSet& request, store::Time now);

}  // namespace isomesh::worklist
