/* Functions of FMI 3.0 for capabilities that the model description does not claim. */

#define UNCLAIMED(function, parameters, ignore)                                              \
    fmi3Status function parameters {                                                        \
        Instance *instance = c;                                                             \
        ignore;                                                                             \
        if (!instance) return fmi3Error;                                                    \
        return FMI(fail(instance, "%s is not provided by this FMU.", #function));           \
    }

UNCLAIMED(fmi3EnterConfigurationMode, (fmi3Instance c), (void)c)
UNCLAIMED(fmi3ExitConfigurationMode, (fmi3Instance c), (void)c)
UNCLAIMED(fmi3EnterStepMode, (fmi3Instance c), (void)c)
UNCLAIMED(fmi3GetNumberOfVariableDependencies,
          (fmi3Instance c, fmi3ValueReference reference, size_t *n),
          ((void)reference, (void)n))
UNCLAIMED(fmi3GetVariableDependencies,
          (fmi3Instance c, fmi3ValueReference dependent, size_t indices[], fmi3ValueReference independents[],
           size_t independent_indices[], fmi3DependencyKind kinds[], size_t n),
          ((void)dependent, (void)indices, (void)independents, (void)independent_indices, (void)kinds, (void)n))
UNCLAIMED(fmi3GetClock, (fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3Clock values[]),
          ((void)references, (void)n, (void)values))
UNCLAIMED(fmi3SetClock, (fmi3Instance c, const fmi3ValueReference references[], size_t n, const fmi3Clock values[]),
          ((void)references, (void)n, (void)values))
UNCLAIMED(fmi3GetIntervalDecimal,
          (fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3Float64 intervals[],
           fmi3IntervalQualifier qualifiers[]),
          ((void)references, (void)n, (void)intervals, (void)qualifiers))
UNCLAIMED(fmi3GetIntervalFraction,
          (fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3UInt64 counters[],
           fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]),
          ((void)references, (void)n, (void)counters, (void)resolutions, (void)qualifiers))
UNCLAIMED(fmi3GetShiftDecimal,
          (fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3Float64 shifts[]),
          ((void)references, (void)n, (void)shifts))
UNCLAIMED(fmi3GetShiftFraction,
          (fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3UInt64 counters[],
           fmi3UInt64 resolutions[]),
          ((void)references, (void)n, (void)counters, (void)resolutions))
UNCLAIMED(fmi3SetIntervalDecimal,
          (fmi3Instance c, const fmi3ValueReference references[], size_t n, const fmi3Float64 intervals[]),
          ((void)references, (void)n, (void)intervals))
UNCLAIMED(fmi3SetIntervalFraction,
          (fmi3Instance c, const fmi3ValueReference references[], size_t n, const fmi3UInt64 counters[],
           const fmi3UInt64 resolutions[]),
          ((void)references, (void)n, (void)counters, (void)resolutions))
UNCLAIMED(fmi3SetShiftDecimal,
          (fmi3Instance c, const fmi3ValueReference references[], size_t n, const fmi3Float64 shifts[]),
          ((void)references, (void)n, (void)shifts))
UNCLAIMED(fmi3SetShiftFraction,
          (fmi3Instance c, const fmi3ValueReference references[], size_t n, const fmi3UInt64 counters[],
           const fmi3UInt64 resolutions[]),
          ((void)references, (void)n, (void)counters, (void)resolutions))
UNCLAIMED(fmi3ActivateModelPartition, (fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time),
          ((void)clock, (void)time))
