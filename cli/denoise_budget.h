// What --time-budget makes of a request: the setting for a sequence, chosen once and recorded in the outputs.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "cli/denoise_job.h"
#include "cli/denoise_plan.h"
#include "cli/time_budget.h"

namespace fathom::cli {

struct BudgetPlan {
  DenoiseSetting setting;
  std::string note;  // a line for the user
};

using ErrorOf = std::function<double(const DenoiseSetting&)>;

// The outputs of the sequence that may be there, in the order of their frames, whether they are among a run's or not.
// The first that was made with a budget decides; where `request.overwrite`, only one made with this budget does. Where
// none does, the setting is chosen (cli/time_budget) among what the request leaves open: the guide of deep frames unless it
// names one, of flat frames the base where it may (DenoiseRequest::anyBase; Open Image Denoise for frames without components,
// which it would drop), and the network's components. `slowness`: of this machine against that of the measurement; asked for
// only where a choice is made. `errorOf`: where given, the best setting that fits of each base is measured by it, and the
// least is taken. `plan`: decided but for what the budget decides. Throws Error where the outputs' setting contradicts the
// request, and where the network that is asked for cannot be had.
BudgetPlan planBudget(const DenoiseRequest& request, const SequencePlan& plan, const std::vector<std::string>& outputs,
                      const std::function<double()>& slowness, const ErrorOf& errorOf = {});

// The request as if the setting had been asked for.
DenoiseRequest withSetting(DenoiseRequest request, const DenoiseSetting& setting);

// A budget as it is recorded: "20 s".
std::string describeBudget(double seconds);

}  // namespace fathom::cli
