"""Header and declarations of the planner block, in portable Structured Text with holes (``@name``)."""

HEADER = """\
(*
    @name: planner function block, IEC 61131-3 Structured Text, from gen-profile.

    Machine: @machine. @axes Cycle @cycle s.
    It plans every motion itself: to a position, at a velocity, and each stop; no load sways afterwards.
    @limits
    @live_lines

    Call it once in every cycle of its task. bEnable takes over fActPosition; the axis follows fPosition
    (with fVelocity and fAcceleration fed forward) while bEnabled is set.
    A rising edge of bExecute moves to fTarget, also on the way to another target. While bVelocity is set, the
    axis follows fVelocityCommand (a stick). bStop stops without sway, as does dropping bVelocity or bEnable.
    bQuickStop brakes at once, with @quick: the load swings then.
    rOverride (above 0, to 1) and fVelocityLimit (0: none) slow down what is planned from then on.
    The live parameters may change at any time. Where they do on the way@live_rates, bPromise drops until
    bEnable does.

    nErrorId: 0 none
              1 fCycleTime is not the cycle time of this block
              2 a live parameter is out of its range
              3 fTarget or fVelocityCommand is no number, or fTarget is not within @targets
              4 fActPosition is no number, or outside the travel
              5 rOverride does not lie above 0 and up to 1, or fVelocityLimit is negative or no number
              6 contradictory commands: a rising edge of bExecute while bVelocity is set
    An error stops the axis without sway; it goes with the next command, or when its cause does.
    nPromise: 0 holds; 1 a live parameter changed on the way@live_rates; 2 quick stop, until bEnable is
              dropped; 3 not ready: no live parameters taken over yet
*)
"""

INTERFACE = """\
FUNCTION_BLOCK @block
VAR_INPUT
    bEnable : BOOL;
    bExecute : BOOL; (* rising edge: move to fTarget *)
    bVelocity : BOOL; (* follow fVelocityCommand *)
    bStop : BOOL; (* stop without sway *)
    bQuickStop : BOOL; (* brake at once: the load swings *)
@target_inputs
@command_inputs
@limit_inputs
    rOverride : LREAL := 1.0; (* of the velocity limit *)
@place_inputs
    fCycleTime : LREAL := @cycle_time; (* s, of the task that calls this block *)
@live_inputs
END_VAR
VAR_OUTPUT
@setpoint_outputs
    bEnabled : BOOL;
    bBusy : BOOL; (* moves, or is about to *)
    bDone : BOOL; (* stands at the target *)
    bInVelocity : BOOL; (* has the velocity of the command *)
    bCommandAborted : BOOL; (* a command to a position was replaced before it ended *)
    bError : BOOL;
    nErrorId : DINT;
    bPromise : BOOL; (* no sway remains after the motion *)
    nPromise : DINT; (* why not *)
    fTimeToGo : LREAL; (* s, to standstill as far as planned *)
@distance_outputs
END_VAR
VAR
    nState : DINT; (* 0 disabled, 1 stands, 2 moves, 3 brakes at once *)
    nCommand : DINT; (* 0 stop, 1 position, 2 velocity *)
    bExecuteBefore : BOOL;
    bVelocityBefore : BOOL;
    bFault : BOOL;
    bReady : BOOL; (* kernel and frequencies are those of the live parameters *)
    bSettled : BOOL; (* of the quick stop: no sway known *)
    fHigh : LREAL;
    fValue : LREAL;
    fWanted : LREAL;
    fShare : LREAL;
    bLiveGood : BOOL;
    bLimitsGood : BOOL;
    bDrifted : BOOL; (* a live parameter changed on the way *)
    bNew : BOOL; (* a slot begins *)
    bSoon : BOOL; (* one will begin in fewer cycles than there are axes *)
    bPulse : BOOL;
    bAway : BOOL; (* an axis will not end at its goal *)
    bWithin : BOOL; (* the goals are nearer than the farthest motion that was measured *)
    bDue : BOOL; (* a motion to the goal is to be planned *)
    bWanted : BOOL; (* a motion is *)
    bWaits : BOOL; (* but live parameters are to be taken over first *)
    bTaken : BOOL; (* they were, since it is wanted *)
    bSurrender : BOOL; (* too far to plan, or planning failed: go there by pulses *)
    fStretch : LREAL; (* so many pulses at least *)
    bBraked : BOOL; (* a stop was planned before the motion to the goal *)
    bBrakes : BOOL; (* is to be *)
    nLeast : DINT; (* slots of a plan that came too late *)
    bTurns : BOOL; (* an axis goes away from its goal: planned is how it turns round, no farther *)

    (* Axes, in m and s. *)
    nAxis : DINT;
    nBase : DINT; (* of an axis: the first of its coefficients *)
    aTarget : ARRAY [0..@last_axis] OF LREAL; (* inputs *)
    aCommand : ARRAY [0..@last_axis] OF LREAL;
    aLimit : ARRAY [0..@last_axis] OF LREAL;
    aActual : ARRAY [0..@last_axis] OF LREAL;
    aPosition : ARRAY [0..@last_axis] OF LREAL; (* outputs *)
    aVelocity : ARRAY [0..@last_axis] OF LREAL;
    aAcceleration : ARRAY [0..@last_axis] OF LREAL;
    aDistanceToGo : ARRAY [0..@last_axis] OF LREAL;
    aStopDistance : ARRAY [0..@last_axis] OF LREAL;
    aGoal : ARRAY [0..@last_axis] OF LREAL; (* of the command to a position *)
    aTop : ARRAY [0..@last_axis] OF LREAL; (* velocity limit of now *)
    nWeighed : DINT; (* axes of which it is known how much of the next pulse is admitted *)
    aShare : ARRAY [0..@last_axis] OF LREAL; (* so much, in m/s *)

    (* The committed future: v(t) is the quadratic B-spline with these coefficients, one a slot. *)
    aFuture : ARRAY [0..@last_future] OF LREAL; (* m/s; an axis's first three belong to the slot of now *)
    nFuture : DINT; (* how many of an axis differ from zero, at most *)
    aFinal : ARRAY [0..@last_axis] OF LREAL; (* where it ends *)
    aFrom : ARRAY [0..@last_axis] OF LREAL; (* where it is at the beginning of the slot *)
    aRest : ARRAY [0..@last_axis] OF LREAL; (* sum of the coefficients from the next slot on *)
    bPulses : BOOL; (* made of the kernel's pulses alone: ends one kernel after the last pulse *)
    bStopPlanned : BOOL;
    nSlot : DINT := 1; (* cycles in a slot *)
    fSlot : LREAL := 1.0; (* s *)
    nTick : DINT; (* cycle within the slot *)
    fPart : LREAL; (* of the slot that has passed *)

    (* Modes of the machine. *)
    aPower : ARRAY [0..@last_power] OF LREAL; (* Chebyshev polynomials of the live parameters *)
    (* Sum and product of the squared frequencies, decays in 1/s, then the matrix of now in 1/s2, by rows:
       sway'' = acceleration - matrix * sway. *)
    aModel : ARRAY [0..@last_model] OF LREAL;
    aLive : ARRAY [0..@last_live] OF LREAL; (* as taken over *)
    aLiveFollowed : ARRAY [0..@last_live] OF LREAL; (* follows as fast as it may change on the way *)
    aLiveNow : ARRAY [0..@last_live] OF LREAL;
    aFrequency : ARRAY [0..@last_mode] OF LREAL; (* rad/s *)
    aHalfRe : ARRAY [0..@last_mode] OF LREAL; (* turn of the mode in half a slot, undamped *)
    aHalfIm : ARRAY [0..@last_mode] OF LREAL;
    aTurnRe : ARRAY [0..@last_mode] OF LREAL; (* in a slot, damped *)
    aTurnIm : ARRAY [0..@last_mode] OF LREAL;
    fRe : LREAL;
    fIm : LREAL;
    fSquare : LREAL;
    fGrowth : LREAL;
    fHalf : LREAL;
@followed
    bSways : BOOL; (* any of them, more than little *)
    bOutdated : BOOL; (* the live parameters were taken over anew since the motion was planned *)
    bLook : BOOL; (* what is left in the modes is to be looked at *)
    bLooked : BOOL; (* it was last, so the live parameters come first *)
    nCalmAxis : DINT; (* whose *)
    bCalming : BOOL; (* the pulse is due where the next slot begins *)
    aCalming : ARRAY [0..@last_column] OF LREAL; (* m/s *)
    aFactors : ARRAY [0..@last_gram] OF LREAL; (* of the kernel's conditions *)

    (* Kernel: a pulse of the velocity that leaves no sway. *)
    aKernelWide : ARRAY [0..@last_column] OF LREAL; (* with zeros at both ends *)
    aKernel : ARRAY [0..@last_column] OF LREAL;
    nKernel : DINT;

    (* Planning, spread over cycles: nJob 0 none, 1 kernel, 2 position, 3 stop, 4 measuring the reach,
       5 calming. *)
    nJob : DINT;
    nPlanAxis : DINT; (* which axis is planned *)
    nPlanRow : DINT; (* the first of its coefficients *)
    nPlanReach : DINT; (* the first of its measured motions *)
    nSized : DINT; (* axes of which it is known how many slots they need *)
    nNeeded : DINT; (* so many *)
    nSlowest : DINT; (* the axis that needs the most *)
    bFirst : BOOL; (* an axis comes before this one *)
    nFitted : DINT; (* axes that have a plan of nSlots *)
    nPhase : DINT;
    nPart : DINT;
    bPlanned : BOOL; (* the plan waits for its slot *)
    nAhead : DINT; (* slots until the plan takes over *)
    nColumns : DINT; (* unknowns of the plan *)
    nOld : DINT; (* slots of the committed future from there *)
    nIteration : DINT;
    nEnough : DINT; (* iterations *)
    nWork : DINT; (* floating-point operations of this cycle *)
    nCost : DINT;
    bRoom : BOOL;
    bGood : BOOL;
    fSign : LREAL;
    fScale : LREAL; (* m/s: velocities are planned as shares of it *)
    fLower : LREAL;
    fUpper : LREAL;
    fRate : LREAL; (* greatest change of the share in a slot *)
    fCurve : LREAL; (* greatest change of this change *)
    fNeed : LREAL; (* sum of shares that the target asks for beyond the old future *)
    fOldSum : LREAL;
    fSum : LREAL;
    fGap : LREAL; (* complementarity *)
    fStepX : LREAL;
    fStepZ : LREAL;
    fBound : LREAL;
    aBound : ARRAY [0..3] OF LREAL; (* of velocity, change, its change, and place *)
    fSlackA : LREAL;
    fSlackB : LREAL;
    fDelta : LREAL;
    fPath : LREAL;
    nRow : DINT;
    nColumn : DINT;
    nOther : DINT;
    nIndex : DINT;
    nMode : DINT;
    nFirst : DINT;
    nLast : DINT;
    nTerm : DINT;
    bMirror : BOOL; (* from rest to rest: the second half mirrors the first and is not sought *)
    bUnfolded : BOOL; (* but the last projection seeks both halves *)
    bScaled : BOOL; (* the plan is that of the axis before, of which this one takes a share *)
    bDamped : BOOL;
    nSlots : DINT; (* of the plan *)
    nTied : DINT; (* the unknown in the middle, which is that of several slots *)
    nMany : DINT; (* so many *)
    nGiven : DINT; (* conditions, with the sum *)
    nAt : DINT; (* first slot of the next chunk *)
    fWaveRe : LREAL; (* of a mode, at that slot *)
    fWaveIm : LREAL;
    fLack : LREAL; (* share of the first slacks' errors that is left *)
    fPlanShare : LREAL; (* of the way between old future and plan *)
    aPlanEnd : ARRAY [0..@last_axis] OF LREAL; (* m *)
    fPlanned : LREAL; (* the last two shares *)
    fPlannedBefore : LREAL;
    aX : ARRAY [0..@last_wide] OF LREAL; (* two committed shares, then those that are sought *)
    aDx : ARRAY [0..@last_wide] OF LREAL;
    aWork : ARRAY [0..@last_wide] OF LREAL;
    aReach : ARRAY [0..@last_reach] OF LREAL; (* sum of shares of motions from rest to rest in cReachSlots *)
    nReach : DINT; (* which is measured next *)
    nReachAxis : DINT; (* of which axis *)
    nUnmeasured : DINT; (* how many were measured for another machine *)
    bMeasured : BOOL;
    aReached : ARRAY [0..@last_axis] OF LREAL; (* greatest of aReach *)
    bStale : BOOL; (* the live parameters have changed since they were taken over *)
    aPlan : ARRAY [0..@last_future] OF LREAL; (* m/s *)
    aE : ARRAY [0..@last_conditions] OF LREAL; (* conditions: modes and their derivatives; row 0: the sum *)
    aY : ARRAY [0..@last_conditions] OF LREAL;
    aB : ARRAY [0..@last_row] OF LREAL;
    aMiss : ARRAY [0..@last_row] OF LREAL;
    aS : ARRAY [0..@last_gram] OF LREAL;
    aSlackA : ARRAY [0..@last_bounds] OF LREAL; (* upper bounds of value, change and its change *)
    aSlackB : ARRAY [0..@last_bounds] OF LREAL; (* lower ones *)
    aPriceA : ARRAY [0..@last_bounds] OF LREAL;
    aPriceB : ARRAY [0..@last_bounds] OF LREAL;
    aLackA : ARRAY [0..@last_bounds] OF LREAL; (* by how much the first slacks were wrong *)
    aLackB : ARRAY [0..@last_bounds] OF LREAL;
    aRatioA : ARRAY [0..@last_bounds] OF LREAL; (* multiplier by slack *)
    aRatioB : ARRAY [0..@last_bounds] OF LREAL;
    aTurnA : ARRAY [0..@last_bounds] OF LREAL; (* step of the multipliers *)
    aTurnB : ARRAY [0..@last_bounds] OF LREAL;
    aStepA : ARRAY [0..@last_bounds] OF LREAL; (* step of the slacks *)
    aStepB : ARRAY [0..@last_bounds] OF LREAL;
    aSteep : ARRAY [0..@last_bounds] OF LREAL; (* inverse of the bound *)
    aWeight : ARRAY [0..@last_bounds] OF LREAL;
    aPush : ARRAY [0..@last_bounds] OF LREAL;
    aH0 : ARRAY [0..@last_wide] OF LREAL; (* five diagonals of the normal matrix, and its factors *)
    aH1 : ARRAY [0..@last_wide] OF LREAL;
    aH2 : ARRAY [0..@last_wide] OF LREAL;

    (* Quick stop. *)
    fQuickTime : LREAL;
    fQuickEnd : LREAL;
    aQuickSign : ARRAY [0..@last_axis] OF LREAL;
    aQuickX : ARRAY [0..@last_axis] OF LREAL;
    aQuickV : ARRAY [0..@last_axis] OF LREAL;
    aQuickA : ARRAY [0..@last_axis] OF LREAL;
    aRise : ARRAY [0..@last_axis] OF LREAL;
    aHold : ARRAY [0..@last_axis] OF LREAL;
    aFall : ARRAY [0..@last_axis] OF LREAL;
    aPeak : ARRAY [0..@last_axis] OF LREAL;
    fTime : LREAL;
    fPeak : LREAL;
    fJerk : LREAL;
END_VAR
VAR CONSTANT
@constants
END_VAR
"""
